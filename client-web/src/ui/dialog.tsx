// A question in front of the page, that has to be answered first. Escape and a press beside it answer no.

import type { ComponentChildren, JSX } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

interface DialogProps {
  readonly title: string;
  readonly test: string;
  readonly children: ComponentChildren;
  readonly onClose: () => void;
}

export function Dialog({ title, test, children, onClose }: DialogProps): JSX.Element {
  const element = useRef<HTMLDialogElement>(null);
  // Before the next frame: keys that are pressed meanwhile are the dialog's.
  useLayoutEffect(() => {
    const dialog = element.current;
    dialog?.showModal();
    // Closed while it still stands in the page, it gives the focus back to where that was.
    return () => dialog?.close();
  }, []);
  return (
    <dialog
      ref={element}
      aria-labelledby={`${test}-title`}
      data-testid={test}
      onCancel={(event) => {
        event.preventDefault();
        onClose();
      }}
      onClick={({ target }) => {
        if (target === element.current) onClose();
      }}
    >
      <div class="inside">
        <h2 id={`${test}-title`}>{title}</h2>
        {children}
      </div>
    </dialog>
  );
}
