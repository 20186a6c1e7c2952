// The shell: name, pages, session, state and theme above; the page below; a banner between when something is amiss.

import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import { fixed } from "./format";
import { addressOf, currentPage, PAGES } from "./pages";
import { live, openSession } from "./store";
import { nextTheme, themeChoice } from "./theme";
import { showToken } from "./token";
import { Tour, TourButton } from "./tour/tour";

export function App(): JSX.Element {
  useSignalEffect(() => {
    document.title = titleOf(live.session.value?.id, live.isCurrent.value ? live.session.value?.state : "away");
  });
  const Current = currentPage.value.component;
  const isLive = currentPage.value.path === "live";
  return (
    <div class="shell" data-current={live.isCurrent.value}>
      <header class="bar">
        <a class="brand" href="#/live" aria-label="teleclay, live page">
          <img src="./favicon.svg" alt="" width="22" height="22" />
          <span>teleclay</span>
        </a>
        <nav aria-label="Pages">
          {PAGES.map((page) => (
            <a key={page.path} class="tab" href={addressOf(page)} aria-current={page === currentPage.value ? "page" : undefined}>
              {page.title}
            </a>
          ))}
        </nav>
        <span class="spacer" />
        <SessionChoice />
        <StateBadge />
        <LinkBadge />
        {isLive && <TourButton />}
        <ThemeButton />
      </header>
      <Banner />
      <main>
        <Current />
      </main>
      {isLive && <Tour />}
    </div>
  );
}

function titleOf(session: string | undefined, state: string | undefined): string {
  return [state, session, "teleclay"].filter((part) => part !== undefined).join(" · ");
}

function SessionChoice(): JSX.Element | null {
  const current = useComputed(() => live.session.value?.id);
  const sessions = live.connection.sessions.value;
  if (sessions.length === 0) return null;
  return (
    <label class="choice">
      <span>session</span>
      <select value={current.value ?? sessions[0]} onChange={({ currentTarget }) => openSession(currentTarget.value)}>
        {sessions.map((id) => <option key={id} value={id}>{id}</option>)}
      </select>
    </label>
  );
}

/** What the loop does, in a word. */
function StateBadge(): JSX.Element | null {
  const state = useComputed(() => live.session.value?.state);
  if (state.value === undefined) return null;
  return <span class="badge" data-state={state.value} data-testid="state">{state.value}</span>;
}

/** Whether the page is fed, how far the server is, and what watching costs. */
function LinkBadge(): JSX.Element {
  const rate = useSignal(0);
  useEffect(() => {
    let before = live.received_bytes;
    const timer = setInterval(() => {
      rate.value = (live.received_bytes - before) * 8;
      before = live.received_bytes;
    }, 1000);
    return () => clearInterval(timer);
  }, []);
  const { name } = live.connection.phase.value;
  const ping_ms = live.connection.ping_ms.value;
  const text = name === "open" ? `${fixed(rate.value / 1e6, 2)} Mbit/s` : name;
  const title = `page to server and back: ${fixed(ping_ms, 1)} ms; received by this page: ${fixed(rate.value / 1e6, 2)} Mbit/s`;
  return (
    <span class="badge link" data-phase={name} title={title} data-testid="link">
      <i class="dot" aria-hidden="true" />
      <span class="words">{text}</span>
    </span>
  );
}

const THEME_SIGNS = { auto: "◐", light: "☀", dark: "☾" } as const;

function ThemeButton(): JSX.Element {
  const choice = themeChoice.value;
  return (
    <button type="button" class="icon" onClick={nextTheme} aria-label={`Theme: ${choice}. Change`} title={`theme: ${choice}`}>
      {THEME_SIGNS[choice]}
    </button>
  );
}

function Banner(): JSX.Element | null {
  const phase = live.connection.phase.value;
  const fault = useComputed(() => live.session.value?.fault ?? undefined);
  if (phase.name === "away") {
    return (
      <div class="banner away" role="alert" data-testid="banner">
        <i class="spinner" aria-hidden="true" />
        <span>
          {phase.because === undefined ? "Server away, trying again" : `The server closed the stream: ${phase.because}. Trying again`}
          {phase.attempts < 2 ? "" : ` (attempt ${phase.attempts})`}
        </span>
        <button type="button" onClick={() => live.connection.retryNow()}>Try now</button>
      </div>
    );
  }
  if (phase.name === "locked") return <TokenBanner because={phase.because} />;
  if (phase.name === "empty") {
    return (
      <div class="banner" role="status" data-testid="banner">
        <span>The server has no session yet.</span>
        <button type="button" onClick={() => void createDemo()}>Create session demo</button>
      </div>
    );
  }
  if (fault.value !== undefined) {
    return (
      <div class="banner fault" role="alert" data-testid="banner">
        <strong>Fault</strong>
        <span>{fault.value}</span>
      </div>
    );
  }
  return null;
}

/** Asks for the token of a server that wants one. */
function TokenBanner({ because }: { because: string }): JSX.Element {
  const words = useSignal("");
  const show = (event: Event): void => {
    event.preventDefault();
    if (words.value.trim() === "") return;
    showToken(words.value.trim());
    live.connection.retryNow();
  };
  return (
    <form class="banner" onSubmit={show} data-testid="banner">
      <label class="token">
        <span>This server wants a token ({because}). Open the link of an invite, or enter one:</span>
        <input
          type="password"
          autocomplete="off"
          value={words.value}
          onInput={({ currentTarget }) => (words.value = currentTarget.value)}
          data-testid="token"
        />
      </label>
      <button type="submit">Show it</button>
    </form>
  );
}

async function createDemo(): Promise<void> {
  const outcome = await live.api.create({ id: "demo" });
  if (outcome.kind === "problem") live.report("error", outcome.problem.detail);
  live.connection.retryNow();
}
