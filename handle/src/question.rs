//! Questions under a lease, and answers that only the server of that lease can give.
//!
//! Anybody on the network may answer a query. What does not carry the server's seal over this very question is passed
//! over, and nobody else's silence is waited for.

use std::collections::BTreeMap;
use std::time::Duration;

use teleclay_channel::{Channel, Purpose};
use teleclay_proto::Part;
use teleclay_proto::join::LeaseRequest;
use zenoh::Session;
use zenoh::query::{ConsolidationMode, QueryTarget};

/// A question.
pub(crate) struct Question<'a> {
    pub(crate) session: &'a Session,
    pub(crate) key: &'a str,
    pub(crate) purpose: Purpose,
    pub(crate) channel: &'a Channel,
    pub(crate) lease: u32,
    /// The answer is waited for this long.
    pub(crate) within: Duration,
    /// Longer answers are not read, bytes.
    pub(crate) longest: usize,
}

impl Question<'_> {
    /// The answer.
    ///
    /// # Errors
    /// None comes, or a longer one; in words.
    pub(crate) async fn ask(&self) -> Result<Vec<u8>, String> {
        let mut answer = None;
        self.hear(|part| {
            answer = Some(part.to_vec());
            Ok(true)
        })
        .await?;
        answer.ok_or_else(|| "nobody answers".to_owned())
    }

    /// The parts of an answer that has several, in their order.
    ///
    /// # Errors
    /// Not all of them come, or more than there may be; in words.
    pub(crate) async fn ask_for_parts(&self) -> Result<Vec<Vec<u8>>, String> {
        let mut parts = BTreeMap::new();
        let (mut bytes, mut wanted) = (0, None);
        self.hear(|part| {
            let part = Part::decode(part).map_err(|error| error.to_string())?;
            bytes += part.content.len();
            if self.longest < bytes {
                return Err(format!(
                    "`{}` has more than {} bytes",
                    self.key, self.longest
                ));
            }
            wanted = Some(part.count);
            parts.insert(part.index, part.content.to_vec());
            Ok(parts.len() == part.count as usize)
        })
        .await?;
        match wanted {
            None => Err("nobody answers".to_owned()),
            Some(count) if parts.len() < count as usize => Err(format!(
                "{} of {count} parts of `{}` came",
                parts.len(),
                self.key
            )),
            Some(_) => Ok(parts.into_values().collect()),
        }
    }

    /// Hands what the server says to `take`, until that has enough.
    async fn hear(
        &self,
        mut take: impl FnMut(&[u8]) -> Result<bool, String>,
    ) -> Result<(), String> {
        let request = serde_json::to_vec(&LeaseRequest { lease: self.lease })
            .expect("requests have no maps and no values that JSON lacks");
        let question = self.channel.seal(self.purpose, &request);
        let replies = self
            .session
            .get(self.key)
            .payload(question.clone())
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(self.within)
            .await
            .map_err(|error| error.to_string())?;
        while let Ok(reply) = replies.recv_async().await {
            // Zenoh itself answers with an error when the time is over.
            let Ok(sample) = reply.result() else { continue };
            if self.longest < sample.payload().len() {
                continue;
            }
            let sealed = sample.payload().to_bytes();
            if let Ok(part) = self.channel.open_answer(self.purpose, &question, &sealed)
                && take(part)?
            {
                break;
            }
        }
        Ok(())
    }
}
