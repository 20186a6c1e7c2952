// The theory's calls, one question each; they outlive their pages, so that coming back shows what was there.

import {
  decodeCuttingAnswer, decodeInverseAnswer, decodeJacobianAnswer, decodeLoopAnswer, decodeWorkspaceAnswer,
} from "../protocol/text";
import type {
  CuttingAnswer, CuttingRequest, InverseAnswer, InverseRequest, JacobianAnswer, JacobianRequest, LoopAnswer, LoopRequest,
  WorkspaceAnswer, WorkspaceRequest,
} from "../protocol/theory";
import { API } from "./connection";
import type { Platform } from "./platform";
import { Question } from "./question";

/** A hand on a slider sees answers to sixteen of its moves a second. */
const SLIDER_MS = 60;
/** The server itself gives up on an experiment or a map that takes longer. */
const LONG_MS = 12_000;

export class Theory {
  readonly loop: Question<LoopRequest, LoopAnswer>;
  readonly cutting: Question<CuttingRequest, CuttingAnswer>;
  readonly inverse: Question<InverseRequest, InverseAnswer>;
  readonly jacobian: Question<JacobianRequest, JacobianAnswer>;
  readonly workspace: Question<WorkspaceRequest, WorkspaceAnswer>;

  constructor(platform: Platform) {
    this.loop = new Question(platform, { path: `${API}/analysis/loop`, decode: decodeLoopAnswer, gather_ms: SLIDER_MS });
    this.cutting = new Question(platform, { path: `${API}/experiments/cutting`, decode: decodeCuttingAnswer, patience_ms: LONG_MS });
    this.inverse = new Question(platform, { path: `${API}/kinematics/inverse`, decode: decodeInverseAnswer, gather_ms: SLIDER_MS });
    this.jacobian = new Question(platform, { path: `${API}/kinematics/jacobian`, decode: decodeJacobianAnswer, gather_ms: SLIDER_MS });
    this.workspace = new Question(platform, { path: `${API}/kinematics/workspace`, decode: decodeWorkspaceAnswer, patience_ms: LONG_MS });
  }
}
