//! A port on a file of /dev/input.

use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use evdev::raw_stream::RawDevice;
use evdev::{
    EventType, FFEffect, FFEffectCode, FFEffectData, FFEffectKind, FFEnvelope, FFReplay, FFTrigger,
    InputEvent, SynchronizationCode,
};

use super::effect::LASTS_MS;
use super::port::{AxisInfo, Effect, InputPort, PadEvent, PadNature, PadState, PortError};
use super::scan::Scan;

/// Batches of 32 events that are read at one step: a device that tells of eight axes a thousand times a second fills
/// two.
const BATCHES: usize = 8;

/// An opened device that nobody else gets events of. What it renders ends with it.
pub struct EvdevPort {
    device: RawDevice,
    effect: Option<FFEffect>,
}

impl EvdevPort {
    /// Opens a device for reading and writing, and takes it for this program alone.
    ///
    /// # Errors
    /// It is not there, barred, or taken.
    pub fn open(path: &Path) -> Result<Self, PortError> {
        let mut device = raw(path)?;
        device.grab()?;
        Ok(Self {
            device,
            effect: None,
        })
    }
}

impl InputPort for EvdevPort {
    fn nature(&self) -> PadNature {
        nature(&self.device)
    }

    fn read(&mut self, events: &mut Vec<PadEvent>) -> Result<(), PortError> {
        for _ in 0..BATCHES {
            match self.device.fetch_events() {
                Ok(come) => events.extend(come.filter_map(|event| meaning(&event))),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn state(&mut self) -> Result<PadState, PortError> {
        let axes = self.device.get_absinfo()?;
        let axes = axes.map(|(code, info)| AxisInfo {
            code: code.0,
            least: info.minimum(),
            most: info.maximum(),
            value: info.value(),
        });
        Ok(PadState {
            axes: axes.collect(),
            down: self
                .device
                .get_key_state()?
                .iter()
                .map(|key| key.0)
                .collect(),
        })
    }

    fn play(&mut self, effect: Effect) -> Result<(), PortError> {
        let data = data(effect);
        let uploaded = match &mut self.effect {
            Some(uploaded) => {
                uploaded.update(data)?;
                uploaded
            }
            None => self.effect.insert(self.device.upload_ff_effect(data)?),
        };
        Ok(uploaded.play(1)?)
    }

    fn silence(&mut self) -> Result<(), PortError> {
        // Dropping an effect takes it off the device.
        match self.effect.take() {
            Some(mut effect) => Ok(effect.stop()?),
            None => Ok(()),
        }
    }
}

impl std::fmt::Debug for EvdevPort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EvdevPort")
            .field("name", &self.device.name())
            .finish_non_exhaustive()
    }
}

/// What lies in a folder: every `event…` file with what it is, or why nobody knows. Nothing is taken for good.
#[must_use]
pub fn scan(folder: &Path) -> Scan {
    let Ok(files) = std::fs::read_dir(folder) else {
        return Scan::new();
    };
    let paths = files.flatten().map(|file| file.path());
    let mut paths: Vec<_> = paths
        .filter(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("event")
        })
        .collect();
    paths.sort_unstable();
    let looked = paths.into_iter().map(|path| {
        let nature = raw(&path).and_then(|mut device| {
            // Who takes it for a moment learns whether somebody else has it.
            device.grab()?;
            device.ungrab()?;
            Ok(nature(&device))
        });
        (path, nature)
    });
    looked.collect()
}

fn raw(path: &Path) -> Result<RawDevice, PortError> {
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(libc::O_NONBLOCK)
        .open(path)?;
    Ok(RawDevice::try_from(file)?)
}

fn meaning(event: &InputEvent) -> Option<PadEvent> {
    let (code, value) = (event.code(), event.value());
    match event.event_type() {
        EventType::ABSOLUTE => Some(PadEvent::Axis { code, value }),
        EventType::KEY => Some(PadEvent::Key {
            code,
            is_down: value != 0,
        }),
        EventType::SYNCHRONIZATION => {
            (code == SynchronizationCode::SYN_DROPPED.0).then_some(PadEvent::Dropped)
        }
        _ => None,
    }
}

fn nature(device: &RawDevice) -> PadNature {
    let effects = device.supported_ff();
    let has = |code: FFEffectCode| effects.is_some_and(|effects| effects.contains(code));
    let keys = device.supported_keys().into_iter();
    let axes = device.supported_absolute_axes().into_iter();
    PadNature {
        name: device.name().unwrap_or("without a name").to_owned(),
        keys: keys.flat_map(|keys| keys.iter()).map(|key| key.0).collect(),
        axes: axes
            .flat_map(|axes| axes.iter())
            .map(|axis| axis.0)
            .collect(),
        rumbles: has(FFEffectCode::FF_RUMBLE),
        pushes: has(FFEffectCode::FF_CONSTANT),
    }
}

fn data(effect: Effect) -> FFEffectData {
    let (direction, kind) = match effect {
        Effect::Rumble { strong, weak } => (
            0,
            FFEffectKind::Rumble {
                strong_magnitude: strong,
                weak_magnitude: weak,
            },
        ),
        Effect::Constant { direction, level } => (
            direction,
            FFEffectKind::Constant {
                level,
                envelope: FFEnvelope {
                    attack_length: 0,
                    attack_level: 0,
                    fade_length: 0,
                    fade_level: 0,
                },
            },
        ),
    };
    FFEffectData {
        direction,
        trigger: FFTrigger::default(),
        replay: FFReplay {
            length: LASTS_MS,
            delay: 0,
        },
        kind,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_is_not_there_is_empty_and_a_file_that_is_no_device_is_passed_over() {
        let folder = std::env::temp_dir().join(format!("teleclay-devices-{}", std::process::id()));
        assert_eq!(scan(&folder), Scan::new());
        std::fs::create_dir(&folder).unwrap();
        let paths = ["event3", "event12", "mouse0"].map(|name| folder.join(name));
        for path in &paths {
            std::fs::write(path, "no device").unwrap();
        }
        let found = scan(&folder);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(
            found.len(),
            2,
            "a mouse has no event in its name: {found:?}"
        );
        assert!(
            found
                .iter()
                .all(|(_, nature)| matches!(nature, Err(PortError::Other(_))))
        );
    }
}
