//! The messages of the protocol: JSON both ways, and bytes for data.

use serde::Deserialize;
use serde_json::json;

use crate::sink::channels::{Topic, Topics};

/// First byte of a message with data, and of one that tells the time.
const MESSAGE_DATA: u8 = 1;
const TIME: u8 = 2;

/// What an app asks. What this server has nothing to do with is left out.
#[derive(Debug, Deserialize, PartialEq)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(super) enum Asked {
    /// To get messages of channels.
    Subscribe {
        /// Of which.
        subscriptions: Vec<Subscription>,
    },
    /// To get them no more.
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        /// Numbers that the app gave them.
        subscription_ids: Vec<u32>,
    },
    /// Something else.
    #[serde(other)]
    Other,
}

/// A subscription.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    /// Number that the app gives it.
    pub id: u32,
    /// Number of the channel, as advertised.
    pub channel_id: u64,
}

impl Subscription {
    /// Its topic, if there is a channel of that number.
    pub fn topic(self, topics: &Topics) -> Option<Topic> {
        let index = usize::try_from(self.channel_id.checked_sub(1)?).ok()?;
        topics.all().nth(index)
    }
}

/// What is said first.
pub(super) fn server_info(session: &str) -> String {
    json!({ "op": "serverInfo", "name": "tactomo", "capabilities": ["time"], "sessionId": session }).to_string()
}

/// All channels, numbered from 1.
pub(super) fn advertise(topics: &Topics) -> String {
    let channels: Vec<_> = topics
        .all()
        .zip(1..)
        .map(|(topic, id)| {
            let channel = topic.channel;
            json!({
                "id": id,
                "topic": topics.name(topic),
                "encoding": "json",
                "schemaName": channel.schema_name(),
                "schema": channel.schema(),
                "schemaEncoding": "jsonschema",
            })
        })
        .collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// A warning for the person at the app.
pub(super) fn warning(text: &str) -> String {
    json!({ "op": "status", "level": 1, "message": text }).to_string()
}

/// Begins a message for a subscription, logged at that time (ns since 1970): opcode, subscription and time, then come the data.
pub(super) fn begin_data(subscription: u32, log_time_ns: u64, out: &mut Vec<u8>) {
    out.clear();
    out.push(MESSAGE_DATA);
    out.extend_from_slice(&subscription.to_le_bytes());
    out.extend_from_slice(&log_time_ns.to_le_bytes());
}

/// What time it is for whoever looks at the data (ns since 1970): opcode and time.
pub(super) fn time(now_ns: u64) -> Vec<u8> {
    [&[TIME][..], &now_ns.to_le_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::ImageMesh;

    use super::*;
    use crate::sink::channels::{Channel, Messages};

    #[test]
    fn what_an_app_asks_is_understood() {
        let asked = |text| serde_json::from_str::<Asked>(text).ok();
        let subscriptions = vec![Subscription { id: 0, channel_id: 3 }, Subscription { id: 7, channel_id: 5 }];
        let topics = Topics::new(vec![Messages::new(&Detector::default(), ImageMesh::default(), 1e-3)]);
        let channel = |index: usize| subscriptions[index].topic(&topics).map(|topic| topic.channel);
        assert_eq!([channel(0), channel(1)], [Some(Channel::Image), None]);
        let text = r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":7,"channelId":5}]}"#;
        assert_eq!(asked(text), Some(Asked::Subscribe { subscriptions }));
        let text = r#"{"op":"unsubscribe","subscriptionIds":[0,1]}"#;
        assert_eq!(asked(text), Some(Asked::Unsubscribe { subscription_ids: vec![0, 1] }));
        assert_eq!(asked(r#"{"op":"getParameters","parameterNames":[]}"#), Some(Asked::Other));
        assert_eq!(asked(r#"{"op":"subscribe"}"#), None);
    }

    #[test]
    fn data_has_the_head_of_the_protocol() {
        let mut out = vec![9; 40];
        begin_data(0x0102_0304, 0x1112_1314_1516_1718, &mut out);
        assert_eq!(out, [1, 4, 3, 2, 1, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11]);
        assert_eq!(time(0x1112_1314_1516_1718), [2, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11]);
    }
}
