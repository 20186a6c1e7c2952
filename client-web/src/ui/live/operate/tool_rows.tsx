// Who holds each tool, who asks for it, and what can be said to that here.

import type { JSX } from "preact";
import type { ToolRow } from "../../../state/manners";
import { ask, deny, handOver, rows, withdraw } from "./operator";

export function ToolRows(): JSX.Element {
  return (
    <ul class="tools" aria-label="Tools" data-testid="tools">
      {rows.value.map((row) => <Row key={row.id} {...row} />)}
    </ul>
  );
}

function Row({ id, holding, requests, request, answers }: ToolRow): JSX.Element {
  return (
    <li data-holding={holding.name} data-testid={`tool-${id}`}>
      <span class="who">tool {id} · <b>{whoOf(holding)}</b></span>
      {request === "may" && <button type="button" onClick={() => void ask(id)} title="asks its holder to hand it over" data-testid="request-control">Ask for it</button>}
      {request === "asked" && <button type="button" onClick={() => void withdraw(id)} data-testid="withdraw-request">Asked; withdraw</button>}
      {!answers && 0 < requests.length && <p class="faint">{requests.join(", ")} {requests.length === 1 ? "asks" : "ask"} for it</p>}
      {answers && requests.map((operator) => (
        <p key={operator} class="asks" role="alert" data-testid="asks">
          <span><b>{operator}</b> asks for it</span>
          <button type="button" onClick={() => void handOver(id, operator)} title="your hand is let go of, and the tool is kept for them" data-testid="grant-control">Hand over</button>
          <button type="button" onClick={() => void deny(id, operator)} data-testid="deny-control">Deny</button>
        </p>
      ))}
    </li>
  );
}

function whoOf(holding: ToolRow["holding"]): string {
  switch (holding.name) {
    case "free": return "free";
    case "kept": return holding.isForMe ? "kept for you, for a moment" : `kept for ${holding.operator}, for a moment`;
    case "mine": return `${holding.operator}, here`;
    case "held": return holding.isSilent ? `${holding.operator}, silent: whoever asks gets it` : holding.operator;
  }
}
