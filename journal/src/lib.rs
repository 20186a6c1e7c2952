//! A journal: records in the order they were made, in files that outlive the process and the power.
//!
//! It knows bytes and files and nothing of what the bytes mean. One directory is one journal:
//!
//! | file | holds |
//! |---|---|
//! | `00000001-000001-00000000000000000001.segment` | records from the last of these numbers on; layout in [`segment`] |
//! | `00000000000000004711.snapshot` | what all records up to that number came to; layout in [`snapshot`] |
//! | `lock` | is locked by the process that writes |
//!
//! | module | holds |
//! |---|---|
//! | [`storage`] | the file operations that a journal needs |
//! | [`disk`] | these operations on a real directory |
//! | [`memory`] | the same in memory, with every fault that a disk may have; for tests |
//! | [`segment`] | layout of a segment and of a record |
//! | [`snapshot`] | layout of a snapshot, how it is written, and what may be removed once it stands |
//! | [`policy`] | sizes and times, and how much history is kept |
//! | [`reader`] | what a directory holds: records, snapshots, damage |
//! | [`writer`] | the writer as a pure state machine on a storage and an argument `now` |
//! | [`thread`] | the thread around it, and the ring that feeds it |
//!
//! *What is promised*: a record up to the [durable](writer::Writer::durable) number is there after any crash, once, in
//! its place. The promise is kept by never trusting a file again after a failed write or sync: what is not durable goes
//! into a new one, and where segments overlap, the newer one counts as far as it goes.

pub mod disk;
pub mod memory;
pub mod policy;
pub mod reader;
pub mod segment;
pub mod snapshot;
pub mod storage;
pub mod thread;
pub mod writer;

pub use disk::Disk;
pub use policy::Policy;
pub use reader::{Damage, ReadError, Reader, Record, Remark};
pub use snapshot::{Snapshot, compact, write_snapshot};
pub use storage::{Entry, Storage};
pub use thread::{Appender, RingFull, Running, Watch, start};
pub use writer::{Failure, OpenError, State, Writer};
