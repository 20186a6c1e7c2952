//! A participant's run: what is shown, asked and kept.

use std::io::{BufRead, Write};
use std::time::Instant;

use anyhow::Result;
use teleclay_study::answer::Answer;
use teleclay_study::file::{Study, Task};
use teleclay_study::run::{Run, Trial};

use crate::answers::Answers;
use crate::session::Shown;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Every trial has been answered.
    Complete,
    /// The participant ended it, and it stays ended.
    Withdrawn,
    /// Nobody types any more; it goes on where it was when it is run again.
    Interrupted,
}

/// Whoever types this at any place ends the run.
const STOP: &str = "stop";

const WELCOME: &str = "\
You may end this at any moment, without a reason: type stop and press Enter. The device then lets go of your hand.
What you answer is kept under a number, not under your name.
";

/// What was typed.
enum Typed {
    Text(String),
    /// The word that ends the run, and whether the session has stopped on it.
    Stop(Result<()>),
    Nothing,
}

/// A terminal, and what stands before it.
pub struct Desk<'a> {
    /// What is typed.
    pub input: &'a mut dyn BufRead,
    /// What is read.
    pub output: &'a mut dyn Write,
    /// Where trials are shown.
    pub session: &'a mut dyn Shown,
}

impl Desk<'_> {
    /// Runs every trial that has no answer yet. Whatever happens, the session is set back to what it was.
    ///
    /// # Errors
    /// The session, the disk or the terminal refuses. What was answered is kept.
    pub fn conduct(&mut self, run: &mut Run<'_>, answers: &mut Answers) -> Result<Ending> {
        let ended = self.trials(run, answers);
        let restored = self.session.restore();
        let ended = ended?;
        restored?;
        let text = match ended {
            Ending::Complete => "That was the last one. Thank you.",
            Ending::Withdrawn => "The study has ended. Thank you.",
            Ending::Interrupted => "Interrupted: run it again to go on.",
        };
        writeln!(self.output, "\n{text}")?;
        Ok(ended)
    }

    fn trials(&mut self, run: &mut Run<'_>, answers: &mut Answers) -> Result<Ending> {
        write!(self.output, "{WELCOME}")?;
        let study = run.study().clone();
        while let Some(trial) = run.next_trial() {
            match self.trial(&study, &trial, run.participant())? {
                Answered::With(answer, response_s) => {
                    answers.keep(run.answer(answer, response_s)?)?;
                }
                Answered::Stop(stopped) => {
                    answers.withdraw()?;
                    stopped?;
                    return Ok(Ending::Withdrawn);
                }
                Answered::Nothing => return Ok(Ending::Interrupted),
            }
        }
        Ok(Ending::Complete)
    }

    fn trial(&mut self, study: &Study, trial: &Trial, participant: u32) -> Result<Answered> {
        writeln!(self.output, "\n{}", trial.heading())?;
        let recording = if study.wants_recordings() {
            let name = format!("{}-p{participant:03}-t{:04}", study.name(), trial.number);
            self.session.record(&name)?
        } else {
            None
        };
        let shown = self.intervals(study, trial);
        let ended = recording.map_or(Ok(()), |id| self.session.end_recording(&id));
        match shown? {
            Typed::Stop(stopped) => Ok(Answered::Stop(stopped.and(ended))),
            Typed::Text(_) => {
                ended?;
                self.ask(study, trial.task)
            }
            Typed::Nothing => {
                ended?;
                Ok(Answered::Nothing)
            }
        }
    }

    fn intervals(&mut self, study: &Study, trial: &Trial) -> Result<Typed> {
        let count = trial.shown.len();
        for (index, presentation) in trial.shown.iter().enumerate() {
            if study.wants_fresh_clay() {
                self.session.freshen()?;
            }
            self.session.show(presentation, trial.line_seeds)?;
            if 1 < count {
                write!(self.output, "Interval {} of {count}. ", index + 1)?;
            }
            write!(self.output, "Press Enter when you have felt enough. ")?;
            match self.typed()? {
                Typed::Text(_) => {}
                other => return Ok(other),
            }
        }
        Ok(Typed::Text(String::new()))
    }

    /// Asks until there is an answer.
    fn ask(&mut self, study: &Study, task: Task) -> Result<Answered> {
        writeln!(self.output, "{}", study.question())?;
        let since = Instant::now();
        loop {
            write!(self.output, "{} > ", task.wanted())?;
            let text = match self.typed()? {
                Typed::Text(text) => text,
                Typed::Stop(stopped) => return Ok(Answered::Stop(stopped)),
                Typed::Nothing => return Ok(Answered::Nothing),
            };
            match task.read(&text) {
                Ok(answer) => return Ok(Answered::With(answer, since.elapsed().as_secs_f64())),
                Err(error) => writeln!(self.output, "{error}")?,
            }
        }
    }

    fn typed(&mut self) -> Result<Typed> {
        self.output.flush()?;
        let mut text = String::new();
        if self.input.read_line(&mut text)? == 0 {
            return Ok(Typed::Nothing);
        }
        let text = text.trim().to_owned();
        if text.eq_ignore_ascii_case(STOP) {
            // The hand before anything else.
            return Ok(Typed::Stop(self.session.stop()));
        }
        Ok(Typed::Text(text))
    }
}

enum Answered {
    With(Answer, f64),
    Stop(Result<()>),
    Nothing,
}
