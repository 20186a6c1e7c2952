// One moment of the loop, for the picture: from telemetry, which is finer than the session's state.

import type { ClayShape, Session, ToolState, Vector } from "../../protocol/session";
import type { HandState } from "../../protocol/hand_module";
import { Channel } from "../../protocol/telemetry";
import type { History } from "../../state/history";
import type { BlockDescription } from "../../scene/clay_mesh";
import type { Pose } from "../../scene/view";

export function poseOf(session: Session, tool: ToolState, history: History, time_s: number): Pose {
  if (history.isEmpty) {
    return {
      tool_m: tool.position_m,
      handle_m: inClay(session, tool, tool.handle_position_m),
      toolForce_n: tool.force_n,
      feltForce_n: tool.felt_force_n,
      isHeldHere: false,
    };
  }
  return {
    tool_m: history.vectorAt(Channel.tool_position_m, time_s),
    handle_m: inClay(session, tool, history.vectorAt(Channel.handle_position_m, time_s)),
    toolForce_n: history.vectorAt(Channel.tool_force_n, time_s),
    feltForce_n: history.vectorAt(Channel.felt_force_n, time_s),
    isHeldHere: false,
  };
}

/** The same of a tool that this page holds: by its own loop, which is ahead of what the server tells. */
export function poseOfHand(session: Session, tool: ToolState, state: HandState, toolForce_n: Vector): Pose {
  return {
    tool_m: state.tool_m,
    // Of a hand that holds nothing no spring goes to the tool.
    handle_m: inClay(session, tool, state.grasp === "held" ? state.hand_m : state.handle_m),
    toolForce_n,
    feltForce_n: state.felt_force_n,
    isHeldHere: true,
  };
}

/** Where the tools are that others hold, m. */
export function othersOf(session: Session, tool: ToolState, historyOf: (tool: number) => History, time_s: number): Vector[] {
  return session.tools.filter(({ id, connected }) => connected && id !== tool.id).map(({ id, position_m }) => {
    const history = historyOf(id);
    return history.isEmpty ? position_m : history.vectorAt(Channel.tool_position_m, time_s);
  });
}

/** Where a handle position puts the tool, in the clay's frame. */
export function inClay(session: Session, tool: ToolState, handle_m: Vector): Vector {
  const { home_m } = tool;
  const ratio = session.position_ratio;
  return [home_m[0] + ratio * handle_m[0], home_m[1] + ratio * handle_m[1], home_m[2] + ratio * handle_m[2]];
}

/** The fresh block, as far as the picture needs it. */
export function blockOf(shape: ClayShape): BlockDescription {
  if (shape.kind === "block") {
    const size_m: Vector = shape.size_m ?? [0, 0, 0];
    return { size_m, heights_m: [size_m[2]], steps_m: [0, size_m[0]] };
  }
  const { edges_m = [], depths_of_cut_m = [], base_m = 0, width_m = 0 } = shape;
  const size_m: Vector = [edges_m.at(-1) ?? 0, width_m, base_m + Math.max(0, ...depths_of_cut_m)];
  return { size_m, heights_m: depths_of_cut_m.map((depth) => base_m + depth), steps_m: edges_m };
}

export function length(vector: Vector): number {
  return Math.hypot(...vector);
}
