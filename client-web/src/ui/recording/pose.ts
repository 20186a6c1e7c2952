// The tools of a moment, for the picture and for the numbers beside it.

import type { FilmMoment, FilmSettings, FilmTool } from "../../protocol/film";
import type { Vector } from "../../protocol/session";
import { Channel } from "../../protocol/telemetry";
import type { Pose } from "../../scene/view";

/** A tool that was told longer ago than this is not shown, s: recordings show tools ten times a second and more. */
const STALE_S = 1;

export function vectorOf(tool: FilmTool, channel: number): Vector | undefined {
  const [x, y, z] = tool.values.slice(channel, channel + 3);
  return typeof x === "number" && typeof y === "number" && typeof z === "number" ? [x, y, z] : undefined;
}

/** Whether somebody held the tool then, and the recording shows it. */
export function isShown({ at_s }: FilmMoment, tool: FilmTool): boolean {
  return tool.holder !== null && tool.told_s !== null && at_s - tool.told_s < STALE_S;
}

export function poseOf(moment: FilmMoment, number: number): Pose | undefined {
  const tool = moment.tools.find((one) => one.tool === number);
  if (tool === undefined || moment.settings === null || !isShown(moment, tool)) return undefined;
  const tool_m = vectorOf(tool, Channel.tool_position_m);
  const handle_m = vectorOf(tool, Channel.handle_position_m);
  if (tool_m === undefined) return undefined;
  return {
    tool_m,
    handle_m: handle_m === undefined ? tool_m : inClay(moment.settings, handle_m),
    // What the recording leaves out has no arrow.
    toolForce_n: vectorOf(tool, Channel.tool_force_n) ?? [0, 0, 0],
    feltForce_n: vectorOf(tool, Channel.felt_force_n) ?? [0, 0, 0],
    isHeldHere: false,
  };
}

/** Where the other tools were that somebody held, m. */
export function othersOf(moment: FilmMoment, number: number): Vector[] {
  return moment.tools.flatMap((tool) => {
    const place = vectorOf(tool, Channel.tool_position_m);
    return tool.tool !== number && place !== undefined && isShown(moment, tool) ? [place] : [];
  });
}

/** Where a handle position puts the tool, in the clay's frame. */
export function inClay({ home_m, position_ratio }: FilmSettings, handle_m: Vector): Vector {
  return [home_m[0] + position_ratio * handle_m[0], home_m[1] + position_ratio * handle_m[1], home_m[2] + position_ratio * handle_m[2]];
}
