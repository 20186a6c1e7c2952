//! What is said of a recording and of a moment of it, as JSON: what a page reads, and `teleclay-replay --at-s` prints.
//! Moments are seconds since the recording began; the TypeScript side is `client-web/src/protocol/film.ts`.

use serde_json::{Value, json};

use crate::reel::{End, Gap, Mark, Reel};
use crate::scene::{Scene, Why};

const NS_PER_S: f64 = 1e9;

/// All that is known of a recording, marks from `first_mark` on among it.
#[must_use]
pub fn of_recording(reel: &Reel, first_mark: usize) -> Value {
    let facts = reel.facts();
    let since = |ns: u64| since(facts.from_ns, ns);
    let marks = reel.marks().get(first_mark..).unwrap_or_default();
    let mark = |mark: &Mark| {
        let level = ["info", "warning", "error"][usize::from(mark.level).min(2)];
        json!({ "at_s": since(mark.time_ns), "level": level, "text": mark.text })
    };
    let gap = |gap: &Gap| {
        json!({
            "from_s": since(gap.lost.since_ns),
            "to_s": gap.until_ns.map(since),
            "why": why(&gap.lost.why),
        })
    };
    json!({
        "session": facts.session,
        "lasts_s": since(facts.to_ns),
        "ticks": facts.ticks,
        "dropped": reel.last().dropped,
        "bytes": facts.bytes,
        "hashes": facts.hashes,
        "hash": facts.hash.map(|[told, _]| hex(told)),
        "differs_s": facts.differs_ns.map(since),
        "end": match facts.end {
            End::Ahead => "ahead",
            End::Whole => "whole",
            End::CutOff => "cut_off",
        },
        "reason": facts.reason,
        "tools": reel.last().tools.iter().map(|tool| tool.told_ns != 0).collect::<Vec<_>>(),
        "marks": marks.iter().map(mark).collect::<Vec<_>>(),
        "gaps": reel.gaps().iter().map(gap).collect::<Vec<_>>(),
        "column_s": reel.overview().map_or(0.0, |overview| overview.width_ns() as f64 / NS_PER_S),
        "keyframe_s": reel.keyframe_ns() as f64 / NS_PER_S,
        "keyframe_bytes": reel.keyframe_bytes(),
    })
}

/// A moment. The values of a tool are in the order of [`quantity`](crate::scene::quantity).
#[must_use]
pub fn of_moment(from_ns: u64, scene: &mut Scene) -> Value {
    let clay = scene
        .clay()
        .map(|clay| json!({ "hash": hex(clay.hash()), "remaining_units": clay.remaining_units() }));
    let holders: Vec<_> = scene
        .holders()
        .map(|name| name.map(str::to_owned))
        .collect();
    let head = &scene.head;
    let tools = head.tools.iter().enumerate().map(|(slot, tool)| {
        let holder = holders.get(slot).cloned().flatten();
        // Where the history is unknown, what the link said last has to do.
        let linked = Some(&tool.operator).filter(|name| holders.is_empty() && !name.is_empty());
        json!({
            "tool": slot + 1,
            "told_s": (tool.told_ns != 0).then(|| since(from_ns, tool.told_ns)),
            "holder": holder.or_else(|| linked.cloned()),
            "is_connected": tool.is_connected,
            // JSON has no number that is none.
            "values": tool.values.iter().map(|value| value.is_finite().then_some(*value)).collect::<Vec<_>>(),
        })
    });
    json!({
        "at_s": since(from_ns, head.time_ns),
        "tick": head.tick,
        "is_full": head.is_full,
        "clay": clay,
        "lost": head.lost.as_ref().map(|lost| why(&lost.why)),
        "tools": tools.collect::<Vec<_>>(),
        "settings": head.settings.as_ref().map(|settings| json!({
            "revision": settings.revision,
            "scheme": settings.spec.scheme,
            "shape": settings.spec.clay.shape,
            "tool": settings.spec.tool,
            "position_ratio": settings.parameters.position_ratio,
            "home_m": settings.parameters.home_m,
            "tick_s": settings.parameters.tick_s,
            "is_paused": settings.is_paused,
        })),
    })
}

fn why(why: &Why) -> Value {
    match why {
        Why::Dropped { ticks } => json!({ "kind": "dropped", "ticks": ticks }),
        Why::Missing { ticks } => json!({ "kind": "missing", "ticks": ticks }),
        Why::LeadsElsewhere => json!({ "kind": "elsewhere" }),
        Why::Broken { why } => json!({ "kind": "broken", "why": why }),
    }
}

fn since(from_ns: u64, ns: u64) -> f64 {
    ns.saturating_sub(from_ns) as f64 / NS_PER_S
}

fn hex(hash: u64) -> String {
    format!("{hash:016x}")
}
