// A batch of telemetry: what hand, handle, tool and clay did, sample by sample.

import { DecodeError, encodeHeader, expectKind, HEADER_BYTES, Kind } from "./header";

/** Where each quantity starts within a sample of 27 values; vectors are x, y, z in the clay's axes. */
export const Channel = {
  hand_force_n: 0,
  felt_force_n: 3,
  tool_force_n: 6,
  handle_position_m: 9,
  tool_position_m: 12,
  handle_velocity_m_s: 15,
  tool_velocity_m_s: 18,
  energy_handle_j: 21,
  energy_tool_j: 22,
  rtt_s: 23,
  correction_step_n: 24,
  correction_held_n: 25,
  age_s: 26,
} as const;
export const CHANNELS = 27;

const FIXED_BYTES = HEADER_BYTES + 24;
const SAMPLE_BYTES = CHANNELS * 4;

export interface TelemetryBatch {
  readonly sequence: number;
  readonly tool: number;
  readonly period_us: number;
  /** Samples this reader lost since its last batch. */
  readonly dropped: number;
  readonly first_time_s: number;
  /** `sample_count` times CHANNELS values. */
  readonly values: Float32Array;
}

export function decodeTelemetry(buffer: ArrayBuffer): TelemetryBatch {
  const bytes = new DataView(buffer);
  const { sequence } = expectKind(bytes, Kind.telemetry);
  if (bytes.byteLength < FIXED_BYTES) {
    throw new DecodeError(`telemetry has ${bytes.byteLength} bytes, its fixed part needs ${FIXED_BYTES}`);
  }
  const count = bytes.getUint32(12, true);
  const need = FIXED_BYTES + count * SAMPLE_BYTES;
  if (bytes.byteLength !== need) {
    throw new DecodeError(`telemetry of ${count} samples has ${bytes.byteLength} bytes, not ${need}`);
  }
  const values = new Float32Array(count * CHANNELS);
  for (let i = 0; i < values.length; i += 1) values[i] = bytes.getFloat32(FIXED_BYTES + 4 * i, true);
  return {
    sequence,
    tool: bytes.getUint32(8, true),
    period_us: bytes.getUint32(16, true),
    dropped: bytes.getUint32(20, true),
    first_time_s: bytes.getFloat64(24, true),
    values,
  };
}

export function encodeTelemetry(batch: TelemetryBatch): ArrayBuffer {
  const buffer = new ArrayBuffer(FIXED_BYTES + 4 * batch.values.length);
  const bytes = new DataView(buffer);
  encodeHeader(bytes, { kind: Kind.telemetry, sequence: batch.sequence });
  bytes.setUint32(8, batch.tool, true);
  bytes.setUint32(12, batch.values.length / CHANNELS, true);
  bytes.setUint32(16, batch.period_us, true);
  bytes.setUint32(20, batch.dropped, true);
  bytes.setFloat64(24, batch.first_time_s, true);
  batch.values.forEach((value, i) => bytes.setFloat32(FIXED_BYTES + 4 * i, value, true));
  return buffer;
}
