// Pages that come when somebody first looks at them: whoever watches the clay need not wait for the theory.

import { signal } from "@preact/signals";
import type { ComponentType, JSX } from "preact";
import { useEffect } from "preact/hooks";

/** A page in the place of one that is still to come. */
export function later(load: () => Promise<ComponentType>): ComponentType {
  const page = signal<ComponentType | undefined>(undefined);
  const isLost = signal(false);
  return function Later(): JSX.Element {
    useEffect(() => {
      if (page.peek() !== undefined) return;
      isLost.value = false;
      load().then((come) => { page.value = come; }, () => { isLost.value = true; });
    }, []);
    const Page = page.value;
    if (Page !== undefined) return <Page />;
    return (
      <div class="page">
        <p role={isLost.value ? "alert" : "status"}>{isLost.value ? "This page did not come: the server does not answer. Load it again." : "One moment …"}</p>
      </div>
    );
  };
}
