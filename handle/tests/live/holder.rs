//! A run under test, and a device that writes down what it is told.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use teleclay_device::DeviceSample;
use teleclay_handle::device::{
    Device, DeviceCommand, DeviceError, DeviceKind, DeviceRequest, DeviceSetup, SimulatedDevice,
};
use teleclay_handle::door::Door;
use teleclay_handle::event::Event;
use teleclay_handle::intent::Intent;
use teleclay_handle::run::{Ending, OpenDevice, Options, Until};
use teleclay_handle::status::Status;
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::Drift;
use teleclay_shell::ticker::Scheduling;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::PATIENCE;
use super::server::TOKEN;

/// A tick as the device saw it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told {
    pub(crate) at: Instant,
    pub(crate) command: DeviceCommand,
}

/// What a device does beyond being simulated.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Quirks {
    /// From this tick on a sensor gives no number.
    pub(crate) blind_from: Option<u64>,
    /// In this tick the operator asks for fresh clay.
    pub(crate) asks_at: Option<u64>,
    /// In this tick the device is gone.
    pub(crate) lost_at: Option<u64>,
}

/// A simulated device, what it was told, and where it was opened.
pub(crate) struct Recorder {
    device: SimulatedDevice,
    told: Arc<Mutex<Vec<Told>>>,
    quirks: Quirks,
    tick: u64,
}

impl Device for Recorder {
    fn name(&self) -> &str {
        "recorder"
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        self.tick += 1;
        if self.quirks.lost_at == Some(self.tick) {
            return Err(DeviceError::Lost {
                device: "recorder".to_owned(),
                reason: "unplugged".to_owned(),
            });
        }
        let mut sample = self.device.sample()?;
        if self.quirks.blind_from.is_some_and(|from| from <= self.tick) {
            sample.velocity_m_s[1] = f64::NAN;
        }
        Ok(sample)
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.told.lock().unwrap().push(Told {
            at: Instant::now(),
            command: *command,
        });
        self.device.command(command)
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        (self.quirks.asks_at == Some(self.tick)).then_some(DeviceRequest::FreshClay)
    }
}

/// A run, from outside.
pub(crate) struct Holder {
    events: UnboundedReceiver<Event>,
    stop: watch::Sender<bool>,
    ending: JoinHandle<Ending>,
    pub(crate) told: Arc<Mutex<Vec<Told>>>,
    pub(crate) opened: Arc<Mutex<Vec<DeviceSetup>>>,
}

impl Holder {
    /// Someone who pushes gently along x.
    pub(crate) fn start(endpoint: &str, quirks: Quirks) -> Self {
        let (told, opened) = (Arc::default(), Arc::default());
        let (write, open) = (Arc::clone(&told), Arc::clone(&opened));
        let open_device: OpenDevice = Box::new(move |setup| {
            let setups: &Mutex<Vec<DeviceSetup>> = &open;
            setups.lock().unwrap().push(*setup);
            let intent = Intent::ConstantForce {
                force_n: [0.5, 0.0, 0.0],
            };
            let device = SimulatedDevice::new(&intent, setup)?;
            Ok(Box::new(Recorder {
                device,
                told: Arc::clone(&write),
                quirks,
                tick: 0,
            }))
        });
        Self::hold(endpoint, open_device, None, told, opened)
    }

    /// Someone whose time is over after `lasts`.
    pub(crate) fn start_for(endpoint: &str, lasts: Duration) -> Self {
        let open_device: OpenDevice =
            Box::new(|setup| Ok(Box::new(SimulatedDevice::new(&Intent::Idle, setup)?)));
        Self::hold(
            endpoint,
            open_device,
            Some(lasts),
            Arc::default(),
            Arc::default(),
        )
    }

    /// With a device of one's own.
    pub(crate) fn start_with(endpoint: &str, open_device: OpenDevice) -> Self {
        Self::hold(endpoint, open_device, None, Arc::default(), Arc::default())
    }

    fn hold(
        endpoint: &str,
        open_device: OpenDevice,
        lasts: Option<Duration>,
        told: Arc<Mutex<Vec<Told>>>,
        opened: Arc<Mutex<Vec<DeviceSetup>>>,
    ) -> Self {
        let (stop, stopped) = watch::channel(false);
        let (emit, events) = unbounded_channel();
        let options = Options {
            door: Door {
                endpoint: endpoint.parse().unwrap(),
                fingerprint: None,
            },
            invite: None,
            session: SessionId::new("demo").expect("a name"),
            realm: RealmName::new("local").expect("a name"),
            operator: "Ada".to_owned(),
            token: Some(TOKEN.to_owned()),
            device: "recorder".to_owned(),
            profile: DeviceKind::Simulated.profile(),
            waits_out_stops: false,
            open_device,
            scheduling: Scheduling::Normal,
            spin: Duration::ZERO,
            clock_drift: Drift::default(),
            recording: None,
        };
        let deadline = lasts.map(|lasts| tokio::time::Instant::now() + lasts);
        let until = Until {
            stop: stopped,
            deadline,
        };
        let ending = tokio::spawn(teleclay_handle::run(options, until, emit));
        Self {
            events,
            stop,
            ending,
            told,
            opened,
        }
    }

    /// The next event that `pick` wants.
    pub(crate) async fn tells<T>(
        &mut self,
        what: &str,
        mut pick: impl FnMut(&Event) -> Option<T>,
    ) -> T {
        let wanted = async {
            loop {
                let event = self
                    .events
                    .recv()
                    .await
                    .unwrap_or_else(|| panic!("the run ended before {what}"));
                if let Some(wanted) = pick(&event) {
                    return wanted;
                }
            }
        };
        tokio::time::timeout(PATIENCE, wanted)
            .await
            .unwrap_or_else(|_| panic!("the handle never told of {what}"))
    }

    /// The lease of the next join.
    pub(crate) async fn joins(&mut self) -> u32 {
        self.tells("a lease", |event| match event {
            Event::Joined { lease, .. } => Some(*lease),
            _ => None,
        })
        .await
    }

    /// The next time that frames flow; how long they did not, if they did before under the same lease.
    pub(crate) async fn goes_live(&mut self) -> Option<f64> {
        self.tells("frames", |event| match event {
            Event::Live { after_s, .. } => Some(*after_s),
            _ => None,
        })
        .await
    }

    /// A status that `pick` wants.
    pub(crate) async fn feels(&mut self, what: &str, pick: impl Fn(&Status) -> bool) -> Status {
        self.tells(what, |event| match event {
            Event::Status(status) if pick(status) => Some(Status::clone(status)),
            _ => None,
        })
        .await
    }

    /// Lets go, and tells how it ended.
    pub(crate) async fn ends(self) -> Ending {
        self.stop.send_replace(true);
        self.ended().await
    }

    /// Waits for the run to end by itself.
    pub(crate) async fn ended(self) -> Ending {
        let ending = tokio::time::timeout(PATIENCE, self.ending)
            .await
            .expect("the run ends");
        ending.expect("the run does not panic")
    }
}
