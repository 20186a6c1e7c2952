//! Who else is in the graph under a name of ours, and means another type by it. Zenoh lets both go on without a word:
//! they have different keys, and neither hears the other. So it is said here.

use std::collections::HashMap;
use std::fmt;

use crate::wire::{End, Typed};

/// More tokens under names of ours are looked at and not kept: anybody can show some.
const MOST_KEPT: usize = 4096;
/// So many strangers are told of, and more are only counted: a log is not theirs to fill.
const MOST_TOLD: usize = 100;

/// What tokens are there, beside ours.
#[derive(Debug)]
pub(crate) struct Graph {
    /// Our session's id: our own tokens come back to us.
    zid: String,
    /// By name, with how many ends of ours have it: one may come before another has quite gone.
    ours: HashMap<String, (Typed, usize)>,
    /// By token; only under names that could be ours.
    others: HashMap<String, End>,
    told: usize,
}

/// Somebody who means another type by a name of ours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stranger {
    end: End,
    ours: Typed,
}

impl fmt::Display for Stranger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { end, ours } = self;
        let Typed {
            name,
            dds_type,
            hash,
        } = &end.typed;
        write!(f, "{} {} of {name} ", end.kind, end.node)?;
        if *dds_type == ours.dds_type {
            write!(
                f,
                "has {dds_type} with the hash {hash}, and here it has {}",
                ours.hash
            )?;
        } else {
            write!(
                f,
                "takes it for {dds_type}, and here it is {}",
                ours.dds_type
            )?;
        }
        f.write_str(": neither hears the other")
    }
}

impl Graph {
    pub(crate) fn new(zid: String) -> Self {
        Self {
            zid,
            ours: HashMap::new(),
            others: HashMap::new(),
            told: 0,
        }
    }

    /// We have a topic or service from now on; tells who takes it for another.
    pub(crate) fn have(&mut self, ours: Typed) -> Vec<Stranger> {
        let strangers = self.others.values();
        let strangers = strangers.filter(|end| end.typed.name == ours.name);
        let strangers: Vec<Stranger> = strangers
            .filter_map(|end| strange(end, &ours))
            .take(MOST_TOLD - self.told)
            .collect();
        self.told += strangers.len();
        let name = ours.name.clone();
        self.ours.entry(name).or_insert((ours, 0)).1 += 1;
        strangers
    }

    /// We have it no longer.
    pub(crate) fn lose(&mut self, name: &str) {
        if let Some((_, ends)) = self.ours.get_mut(name) {
            *ends -= 1;
            if *ends == 0 {
                self.ours.remove(name);
            }
        }
    }

    /// A token is there; tells whose it is where they take something of ours for another.
    pub(crate) fn appear(&mut self, token: &str) -> Option<Stranger> {
        let end = End::of_token(token)?;
        let could_be_ours = end.typed.name.starts_with("/teleclay/");
        let ours = self.ours.get(&end.typed.name);
        if end.zid == self.zid || !(could_be_ours || ours.is_some()) {
            return None;
        }
        let stranger = ours.and_then(|(ours, _)| strange(&end, ours));
        if self.others.len() < MOST_KEPT {
            self.others.insert(token.to_owned(), end);
        }
        let stranger = stranger.filter(|_| self.told < MOST_TOLD)?;
        self.told += 1;
        Some(stranger)
    }

    /// A token has gone.
    pub(crate) fn vanish(&mut self, token: &str) {
        self.others.remove(token);
    }

    /// How many take something of ours for another.
    pub(crate) fn strangers(&self) -> usize {
        let others = self.others.values();
        others
            .filter(|end| {
                let ours = self.ours.get(&end.typed.name);
                ours.is_some_and(|(ours, _)| strange(end, ours).is_some())
            })
            .count()
    }
}

fn strange(end: &End, ours: &Typed) -> Option<Stranger> {
    (end.typed != *ours).then(|| Stranger {
        end: end.clone(),
        ours: ours.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Kind, NodeName, Quality};

    const TOPIC: &str = "/teleclay/demo/tool_1/tool_pose";
    const POSE: &str = "geometry_msgs/msg/PoseStamped";

    fn typed() -> Typed {
        Typed::new(TOPIC, POSE)
    }

    fn token(typed: &Typed) -> String {
        let node = NodeName {
            domain: 0,
            zid: "b2".to_owned(),
            name: "viewer".to_owned(),
        };
        node.token_of(3, Kind::Subscriber, typed, Quality::BestEffort)
    }

    fn graph() -> Graph {
        Graph::new("a1".to_owned())
    }

    /// The type with one character of its name or hash altered.
    fn altered() -> [Typed; 3] {
        let other = |dds_type: &str, hash: &str| Typed {
            dds_type: dds_type.to_owned(),
            hash: hash.to_owned(),
            ..typed()
        };
        let Typed { dds_type, hash, .. } = typed();
        let digit = if hash.ends_with('0') { "1" } else { "0" };
        [
            other(&dds_type.replace("Pose", "pose"), &hash),
            other("geometry_msgs/msg/PoseStamped", &hash),
            other(&dds_type, &format!("{}{digit}", &hash[..hash.len() - 1])),
        ]
    }

    #[test]
    fn whoever_means_the_same_is_no_stranger() {
        let mut graph = graph();
        assert_eq!(graph.have(typed()), []);
        assert_eq!(graph.appear(&token(&typed())), None);
        assert_eq!(graph.strangers(), 0);
    }

    #[test]
    fn a_character_of_type_or_hash_makes_a_stranger_whoever_comes_first() {
        for other in altered() {
            let mut first_we = graph();
            first_we.have(typed());
            let stranger = first_we.appear(&token(&other)).unwrap();
            assert_eq!(first_we.strangers(), 1);
            let mut first_they = graph();
            assert_eq!(first_they.appear(&token(&other)), None);
            assert_eq!(first_they.have(typed()), std::slice::from_ref(&stranger));
            let said = stranger.to_string();
            assert!(
                said.starts_with(&format!("subscriber /viewer of {TOPIC} ")),
                "{said}"
            );
            let what = if other.hash == typed().hash {
                &other.dds_type
            } else {
                &other.hash
            };
            assert!(
                said.contains(what.as_str()) && said.ends_with("hears the other"),
                "{said}"
            );
            first_we.vanish(&token(&other));
            assert_eq!(first_we.strangers(), 0);
            first_they.lose(TOPIC);
            assert_eq!(first_they.strangers(), 0);
        }
    }

    #[test]
    fn our_own_tokens_and_those_of_other_topics_mean_nothing() {
        let mut own = Graph::new("b2".to_owned());
        own.have(typed());
        for other in altered() {
            assert_eq!(own.appear(&token(&other)), None);
        }
        assert_eq!(own.strangers(), 0);
        let mut graph = graph();
        graph.have(typed());
        let elsewhere = Typed::new("/somewhere", "std_msgs/msg/String");
        assert_eq!(graph.appear(&token(&elsewhere)), None);
        assert!(graph.others.is_empty(), "a graph of thousands is not kept");
    }

    #[test]
    fn what_two_ends_have_is_ours_until_both_are_gone() {
        let mut graph = graph();
        graph.have(typed());
        graph.have(typed());
        graph.lose(TOPIC);
        assert!(graph.appear(&token(&altered()[0])).is_some());
        graph.lose(TOPIC);
        assert_eq!(graph.strangers(), 0);
    }

    #[test]
    fn tokens_without_end_fill_neither_memory_nor_log() {
        let mut graph = graph();
        graph.have(typed());
        let told = (0..2 * MOST_KEPT).filter(|number| {
            let other = Typed {
                hash: format!("RIHS01_{number}"),
                ..typed()
            };
            graph.appear(&token(&other)).is_some()
        });
        assert_eq!(told.count(), MOST_TOLD);
        assert_eq!(graph.strangers(), MOST_KEPT);
        assert_eq!(graph.have(typed()), []);
    }

    #[test]
    fn a_topic_that_all_share_is_looked_at_too() {
        let mut graph = graph();
        graph.have(Typed::new("/tf", "tf2_msgs/msg/TFMessage"));
        let stranger = graph.appear(&token(&Typed::new("/tf", "std_msgs/msg/String")));
        assert!(stranger.is_some());
    }
}
