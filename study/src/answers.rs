//! The file of answers of one run. Every line is on disk before the next trial is shown.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use teleclay_study::file::Study;
use teleclay_study::log;
use teleclay_study::run::{Record, Run};

/// An open file of answers.
pub struct Answers {
    file: File,
    path: PathBuf,
}

/// Where the answers of a participant are kept.
pub fn path(folder: &Path, study: &Study, participant: u32) -> PathBuf {
    folder.join(format!("{}-p{participant:03}.answers", study.name()))
}

impl Answers {
    /// Opens the answers of a participant, or begins them; and the run, where it was. Half a line, left by a process
    /// that was killed, is cut off.
    ///
    /// # Errors
    /// The answers are of another study or participant, the participant has ended the run, or the disk refuses.
    pub fn open<'a>(folder: &Path, study: &'a Study, participant: u32) -> Result<(Self, Run<'a>)> {
        let path = path(folder, study, participant);
        let told = || format!("{}", path.display());
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .with_context(told)?;
        file.try_lock()
            .with_context(|| format!("{}: another run writes it", path.display()))?;
        let text = std::fs::read_to_string(&path).with_context(told)?;
        let Some(log) = log::read(&text).with_context(told)? else {
            let run = Run::new(study, participant)?;
            file.set_len(0).with_context(told)?;
            let mut answers = Self { file, path };
            answers.append(&log::head(study, participant))?;
            return Ok((answers, run));
        };
        ensure!(
            !log.is_withdrawn,
            "{}: the participant has ended this run",
            path.display()
        );
        let run = log.run(study, participant).with_context(told)?;
        file.set_len(log.whole_bytes as u64).with_context(told)?;
        file.seek(SeekFrom::End(0)).with_context(told)?;
        Ok((Self { file, path }, run))
    }

    /// Keeps an answer.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(&mut self, record: &Record) -> Result<()> {
        self.append(&log::answer(record))
    }

    /// Keeps that the participant has ended the run.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn withdraw(&mut self) -> Result<()> {
        self.append(&log::withdrawn())
    }

    fn append(&mut self, line: &str) -> Result<()> {
        self.file
            .write_all(line.as_bytes())
            .and_then(|()| self.file.sync_data())
            .with_context(|| format!("cannot write {}", self.path.display()))
    }
}
