// The first eight bytes of every binary message: magic, version, kind, sequence. All little-endian.

export const HEADER_BYTES = 8;
/** The bytes "TC". */
const MAGIC = 0x4354;
const VERSION = 1;

export const Kind = { telemetry: 1, bricks: 2 } as const;
export type Kind = (typeof Kind)[keyof typeof Kind];

/** Bytes that are not a message: what came and what was wanted. */
export class DecodeError extends Error {
  override readonly name = "DecodeError";
}

export interface Header {
  readonly kind: Kind;
  /** Counts the messages of one socket; a gap means that the server dropped some for this reader. */
  readonly sequence: number;
}

export function decodeHeader(bytes: DataView): Header {
  if (bytes.byteLength < HEADER_BYTES) {
    throw new DecodeError(`message has ${bytes.byteLength} bytes, its header needs ${HEADER_BYTES}`);
  }
  const magic = bytes.getUint16(0, true);
  if (magic !== MAGIC) throw new DecodeError(`magic is 0x${magic.toString(16)}, not 0x${MAGIC.toString(16)}`);
  const version = bytes.getUint8(2);
  if (version !== VERSION) throw new DecodeError(`version is ${version}, this page reads ${VERSION}`);
  const kind = bytes.getUint8(3);
  if (kind !== Kind.telemetry && kind !== Kind.bricks) throw new DecodeError(`kind ${kind} is unknown`);
  return { kind, sequence: bytes.getUint32(4, true) };
}

export function encodeHeader(bytes: DataView, header: Header): void {
  bytes.setUint16(0, MAGIC, true);
  bytes.setUint8(2, VERSION);
  bytes.setUint8(3, header.kind);
  bytes.setUint32(4, header.sequence, true);
}

/** The header, provided that it announces `kind`. */
export function expectKind(bytes: DataView, kind: Kind): Header {
  const header = decodeHeader(bytes);
  if (header.kind !== kind) throw new DecodeError(`kind is ${header.kind}, expected ${kind}`);
  return header;
}
