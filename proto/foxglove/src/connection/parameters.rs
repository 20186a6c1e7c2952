//! The parameters that a client sees: the rates, which it may change, and facts, which it may not.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::rate::Rate;
use crate::client::Parameter;

/// The rate of topics that have none of their own, as a parameter.
pub const RATE: &str = "teleclay.rate_hz";

/// The rate of one topic, as a parameter: before the topic's name.
pub const RATE_OF: &str = "teleclay.rate_hz.";

/// Names that a client may ask to be told of, one by one.
const MOST_NAMES: usize = 1024;

/// Rates and facts.
#[derive(Debug)]
pub(super) struct Parameters {
    pub(super) usual: Rate,
    /// What that was to begin with.
    pub(super) first: Rate,
    /// By topic.
    pub(super) rates: BTreeMap<String, Rate>,
    facts: BTreeMap<String, Value>,
    told: Told,
}

/// Which changes a client is told of.
#[derive(Debug)]
enum Told {
    Named(BTreeSet<String>),
    All,
}

impl Parameters {
    pub(super) const fn new(usual: Rate) -> Self {
        Self {
            usual,
            first: usual,
            rates: BTreeMap::new(),
            facts: BTreeMap::new(),
            told: Told::Named(BTreeSet::new()),
        }
    }

    pub(super) fn rate(&self, topic: &str) -> Rate {
        self.rates.get(topic).copied().unwrap_or(self.usual)
    }

    /// Those of these names that there are; all of them where there is no name.
    pub(super) fn named(
        &self,
        names: &[String],
        is_topic: impl Fn(&str) -> bool,
    ) -> Vec<Parameter> {
        if names.is_empty() {
            let rates = self.rates.iter();
            let rates = rates.map(|(topic, rate)| of_rate(format!("{RATE_OF}{topic}"), *rate));
            let facts = self.facts.iter();
            let facts = facts.map(|(name, value)| of_fact(name, value));
            let usual = std::iter::once(of_rate(RATE.to_owned(), self.usual));
            return usual.chain(rates).chain(facts).collect();
        }
        let named = names.iter().filter_map(|name| {
            if name == RATE {
                return Some(of_rate(name.clone(), self.usual));
            }
            if let Some(topic) = name.strip_prefix(RATE_OF) {
                return is_topic(topic).then(|| of_rate(name.clone(), self.rate(topic)));
            }
            self.facts.get(name).map(|value| of_fact(name, value))
        });
        named.collect()
    }

    /// Facts are these from now on. Those that have changed and that the client wants to be told of.
    pub(super) fn set_facts(&mut self, facts: BTreeMap<String, Value>) -> Vec<Parameter> {
        let changed = facts
            .iter()
            .filter(|(name, value)| self.facts.get(*name) != Some(value) && self.tells(name))
            .map(|(name, value)| of_fact(name, value));
        // A parameter without a value is one that is gone.
        let gone = self.facts.keys().filter(|name| !facts.contains_key(*name));
        let gone = gone.filter(|name| self.tells(name)).map(|name| Parameter {
            name: name.clone(),
            value: None,
            kind: None,
        });
        let told = changed.chain(gone).collect();
        self.facts = facts;
        told
    }

    pub(super) fn is_fact(&self, name: &str) -> bool {
        self.facts.contains_key(name)
    }

    /// Whether the client wants to be told of changes of this one.
    pub(super) fn tells(&self, name: &str) -> bool {
        match &self.told {
            Told::Named(names) => names.contains(name),
            Told::All => true,
        }
    }

    pub(super) fn tell(&mut self, names: Vec<String>) {
        if names.is_empty() {
            self.told = Told::All;
        } else if let Told::Named(told) = &mut self.told {
            let room = MOST_NAMES.saturating_sub(told.len());
            told.extend(names.into_iter().take(room));
        }
    }

    pub(super) fn tell_no_longer(&mut self, names: &[String]) {
        match &mut self.told {
            Told::Named(told) if !names.is_empty() => {
                told.retain(|name| !names.contains(name));
            }
            told => *told = Told::Named(BTreeSet::new()),
        }
    }
}

fn of_rate(name: String, rate: Rate) -> Parameter {
    Parameter {
        name,
        value: Some(Value::from(rate.hz())),
        kind: Some("float64".to_owned()),
    }
}

fn of_fact(name: &str, value: &Value) -> Parameter {
    Parameter {
        name: name.to_owned(),
        value: Some(value.clone()),
        kind: None,
    }
}
