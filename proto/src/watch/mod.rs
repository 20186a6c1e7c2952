//! What watchers see: binary telemetry and bricks, and JSON text for everything slow. The binary messages are those of
//! [`teleclay_wire`].

mod text;

pub use teleclay_wire::{
    BRICK_EDGE, BRICK_VOXELS, Brick, BrickBody, BrickContent, BricksHeader, BricksKind, BricksView,
    BricksWriter, ClassesView, FrameError, FramesKind, FramesView, FramesWriter, Kind, MAGIC,
    MAX_FRAMES, MAX_FRAMES_MESSAGE, MAX_MESSAGE, MAX_PACKED, MAX_SAMPLES, Message, PackedBrick,
    TelemetryBatch, TelemetrySample, TelemetryView, TooManySamples, VERSION, pack, renumber,
    unpack, write_classes,
};
pub use text::{ClientText, HandDevice, Level, ServerText, Switch};
