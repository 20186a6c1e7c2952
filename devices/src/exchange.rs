//! What a driver's thread and the tick tell each other: two rings, one writer and one reader each, of fixed length.
//!
//! Nobody waits. News that find no room are told with the next ones, so that no button is lost. A force that is older
//! than [`FORCE_HOLD_NS`] counts as none: a tick that stops leaves a device without force.

use rtrb::{Consumer, Producer, RingBuffer};

use crate::fault::DeviceFault;

/// A quarter of a second of news from a device that tells a thousand times a second.
const NEWS: usize = 256;
/// The driver takes them all at each of its steps.
const ORDERS: usize = 64;
/// Twenty ticks.
pub const FORCE_HOLD_NS: u64 = 20_000_000;

/// What whoever holds the device has done since the last news.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks {
    /// Takes hold. Counts after everything else here.
    pub takes_hold: bool,
    /// Lets go.
    pub lets_go: bool,
    /// Takes the clutch out: the device moves without the handle.
    pub clutches: bool,
    /// Lets the clutch in: whoever held before goes on.
    pub unclutches: bool,
    /// Asks for a fresh block of clay.
    pub wants_clay: bool,
}

impl Marks {
    /// Both, these first. What was begun before a later end is over.
    #[must_use]
    pub fn and_then(self, later: Self) -> Self {
        let is_over = later.lets_go || later.clutches;
        let is_in = later.lets_go || later.takes_hold || later.unclutches;
        Self {
            takes_hold: later.takes_hold || (self.takes_hold && !is_over),
            lets_go: self.lets_go || later.lets_go,
            clutches: later.clutches || (self.clutches && !is_in),
            unclutches: later.unclutches || (self.unclutches && !is_over),
            wants_clay: self.wants_clay || later.wants_clay,
        }
    }
}

/// Where the device is, and what its buttons say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct News {
    /// When it was there, on the exchange's clock, ns.
    pub at_ns: u64,
    /// Displacement from home, m.
    pub position_m: [f64; 3],
    /// What was done.
    pub marks: Marks,
}

/// What the device is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// When, on the exchange's clock, ns.
    pub at_ns: u64,
    /// Force on the hand, N.
    pub force_n: [f64; 3],
}

/// The thread's ends.
#[derive(Debug)]
pub struct DriverEnds {
    news: Producer<News>,
    orders: Consumer<Order>,
    end: Producer<DeviceFault>,
    newest: Option<Order>,
    untold: Option<Marks>,
    most_n: f64,
}

/// The tick's ends.
#[derive(Debug)]
pub struct TickEnds {
    news: Consumer<News>,
    orders: Producer<Order>,
    end: Consumer<DeviceFault>,
}

/// The ends of an exchange in which no force passes `most_n`.
#[must_use]
pub fn exchange(most_n: f64) -> (DriverEnds, TickEnds) {
    let (news, news_read) = RingBuffer::new(NEWS);
    let (orders, orders_read) = RingBuffer::new(ORDERS);
    let (end, end_read) = RingBuffer::new(1);
    let driver = DriverEnds {
        news,
        orders: orders_read,
        end,
        newest: None,
        untold: None,
        most_n,
    };
    let tick = TickEnds {
        news: news_read,
        orders,
        end: end_read,
    };
    (driver, tick)
}

impl DriverEnds {
    /// The force to render at `now_ns`: the newest, if it is new, finite and within the bound. Otherwise none, or the
    /// bound.
    pub fn force(&mut self, now_ns: u64) -> [f64; 3] {
        while let Ok(order) = self.orders.pop() {
            self.newest = Some(order);
        }
        let Some(order) = self.newest else {
            return [0.0; 3];
        };
        let is_new = now_ns.saturating_sub(order.at_ns) <= FORCE_HOLD_NS;
        let is_finite = order.force_n.iter().all(|part| part.is_finite());
        if is_new && is_finite {
            capped(order.force_n, self.most_n)
        } else {
            [0.0; 3]
        }
    }

    /// Adds to what the next news say.
    pub fn mark(&mut self, marks: Marks) {
        self.untold = Some(self.untold.unwrap_or_default().and_then(marks));
    }

    /// Tells the tick.
    pub fn tell(&mut self, news: News) {
        let marks = self.untold.take().unwrap_or_default().and_then(news.marks);
        if self.news.push(News { marks, ..news }).is_err() {
            self.untold = Some(marks);
        }
    }

    /// Tells the tick that the device is lost.
    pub fn end(&mut self, fault: DeviceFault) {
        // One end is enough.
        let _ = self.end.push(fault);
    }
}

impl TickEnds {
    /// The next news.
    ///
    /// # Errors
    /// The device is lost. What it said before counts no more.
    pub fn poll(&mut self) -> Result<Option<News>, DeviceFault> {
        match self.end.pop() {
            Ok(fault) => Err(fault),
            Err(_) => Ok(self.news.pop().ok()),
        }
    }

    /// Whether the thread is there.
    #[must_use]
    pub fn has_driver(&self) -> bool {
        !self.news.is_abandoned()
    }

    /// Gives the device a force.
    pub fn order(&mut self, order: Order) {
        // A full ring means a driver that stands still: when it wakes, what is in there is too old to count.
        let _ = self.orders.push(order);
    }
}

/// `v`, finite, shortened to length `most` where it is longer.
fn capped(v: [f64; 3], most: f64) -> [f64; 3] {
    let largest = v.iter().fold(0.0_f64, |most, part| most.max(part.abs()));
    if largest <= 0.0 {
        return [0.0; 3];
    }
    // Divided first, so that no square is too large for a number.
    let scaled = v.map(|part| part / largest);
    let length = scaled.iter().map(|part| part * part).sum::<f64>().sqrt();
    if largest <= most / length {
        v
    } else {
        scaled.map(|part| part * (most / length))
    }
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    reason = "a force within the bounds is passed on to the last bit, and none is exactly none"
)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn only_a_new_finite_force_within_the_bound_reaches_a_device() {
        let (mut driver, mut tick) = exchange(5.0);
        assert_eq!(driver.force(0), [0.0; 3]);
        let mut given = |at_ns: u64, force_n: [f64; 3], now_ns: u64| {
            tick.order(Order { at_ns, force_n });
            driver.force(now_ns)
        };
        assert_eq!(given(MS, [1.0, -2.0, 0.5], 2 * MS), [1.0, -2.0, 0.5]);
        assert_eq!(given(3 * MS, [f64::NAN, 0.0, 0.0], 3 * MS), [0.0; 3]);
        assert_eq!(given(4 * MS, [0.0, f64::INFINITY, 0.0], 4 * MS), [0.0; 3]);
        let most = given(5 * MS, [0.0, 0.0, -1e300], 5 * MS);
        assert!((most[2] + 5.0).abs() < 1e-12, "{most:?}");
        assert_eq!(given(6 * MS, [1.0, 0.0, 0.0], 26 * MS), [1.0, 0.0, 0.0]);
        assert_eq!(
            driver.force(27 * MS),
            [0.0; 3],
            "the tick has stopped, and the force with it"
        );
    }

    #[test]
    fn no_button_is_lost_while_the_tick_stands_still() {
        let (mut driver, mut tick) = exchange(5.0);
        let press = Marks {
            lets_go: true,
            ..Marks::default()
        };
        for at_ns in 0..1000 {
            let marks = if at_ns == 700 {
                press
            } else {
                Marks::default()
            };
            driver.tell(News {
                at_ns,
                marks,
                ..News::default()
            });
        }
        while tick.poll().unwrap().is_some() {}
        driver.tell(News {
            at_ns: 1000,
            ..News::default()
        });
        assert!(tick.poll().unwrap().unwrap().marks.lets_go);
    }

    #[test]
    fn a_grip_that_was_let_go_of_meanwhile_is_not_taken() {
        let takes = Marks {
            takes_hold: true,
            ..Marks::default()
        };
        let lets_go = Marks {
            lets_go: true,
            ..Marks::default()
        };
        let clutches = Marks {
            clutches: true,
            ..Marks::default()
        };
        assert!(!takes.and_then(lets_go).takes_hold);
        assert!(!takes.and_then(clutches).takes_hold);
        assert!(lets_go.and_then(takes).takes_hold);
        let again = clutches.and_then(takes);
        assert!(again.takes_hold && !again.clutches);
    }

    #[test]
    fn an_end_is_told_before_what_came_before_it() {
        let (mut driver, mut tick) = exchange(5.0);
        driver.tell(News::default());
        let fault = DeviceFault::Lost {
            device: "joystick",
            reason: "unplugged".to_owned(),
        };
        driver.end(fault.clone());
        assert_eq!(tick.poll(), Err(fault));
        drop(driver);
        assert!(!tick.has_driver());
    }
}
