//! A client that follows the published protocol: <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.

use std::io::Read;
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::Response;
use tungstenite::{Message, WebSocket, client};

use crate::program::Live;

type Socket = WebSocket<TcpStream>;
type Answer = Response<Option<Vec<u8>>>;

/// Connects and offers a subprotocol.
fn connect(at: &str, subprotocol: &str) -> Result<(Socket, Answer), String> {
    connect_from(at, subprotocol, None)
}

/// The same as a page of an origin does.
fn connect_from(at: &str, subprotocol: &str, origin: Option<&str>) -> Result<(Socket, Answer), String> {
    let mut request = format!("ws://{at}").into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", subprotocol.parse().unwrap());
    if let Some(origin) = origin {
        request.headers_mut().insert("origin", origin.parse().unwrap());
    }
    client(request, TcpStream::connect(at).unwrap()).map_err(|error| error.to_string())
}

fn json(socket: &mut Socket) -> Value {
    loop {
        if let Message::Text(text) = socket.read().unwrap() {
            return serde_json::from_str(&text).unwrap();
        }
    }
}

/// Subscription, log time (ns) and data of the next message, for which the time was told at most 20 ms before.
fn data(socket: &mut Socket, now_ns: &mut u64) -> (u32, u64, Value) {
    loop {
        if let Message::Binary(bytes) = socket.read().unwrap() {
            if bytes[0] == 2 {
                *now_ns = u64::from_le_bytes(bytes[1..].try_into().unwrap());
                continue;
            }
            let (subscription, log_time_ns, message) = datum(&bytes);
            assert!((*now_ns..*now_ns + 20_000_000).contains(&log_time_ns), "{now_ns} {log_time_ns}");
            return (subscription, log_time_ns, message);
        }
    }
}

/// Subscription, log time (ns) and data of a message.
fn datum(bytes: &[u8]) -> (u32, u64, Value) {
    assert_eq!(bytes[0], 1, "message data");
    let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
    let log_time_ns = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
    (subscription, log_time_ns, serde_json::from_slice(&bytes[13..]).unwrap())
}

fn say(socket: &mut Socket, message: &Value) {
    socket.send(Message::text(message.to_string())).unwrap();
}

#[test]
fn an_app_sees_the_channels_and_gets_those_that_it_subscribes_to() {
    let mut live = Live::start(&["--json", "--solver", "tikhonov", "--foxglove", "0", "--seconds", "60"]);
    let at = live.told("open ws://");
    let (mut socket, response) = connect(&at, "foxglove.sdk.v1, foxglove.websocket.v1").unwrap();
    assert_eq!(response.headers()["sec-websocket-protocol"], "foxglove.websocket.v1");
    let info = json(&mut socket);
    assert!(info["op"] == "serverInfo" && info["capabilities"] == json!(["time"]), "{info}");
    let advertised = json(&mut socket);
    assert_eq!(advertised["op"], "advertise");
    let channels = advertised["channels"].as_array().unwrap();
    let topics: Vec<_> = channels.iter().map(|channel| channel["topic"].as_str().unwrap()).collect();
    assert_eq!(topics, ["/tactomo/touch", "/tactomo/contacts", "/tactomo/image", "/tactomo/readings"]);
    for channel in channels {
        let schema: Value = serde_json::from_str(channel["schema"].as_str().unwrap()).unwrap();
        assert_eq!((&channel["encoding"], &channel["schemaEncoding"]), (&json!("json"), &json!("jsonschema")));
        assert_eq!(schema["title"], channel["schemaName"]);
    }
    // All channels, by numbers of the app's own.
    let subscriptions: Vec<_> =
        channels.iter().zip(70..).map(|(c, id)| json!({"id": id, "channelId": c["id"]})).collect();
    say(&mut socket, &json!({"op": "subscribe", "subscriptions": subscriptions}));
    let mut now_ns = 0;
    let messages: Vec<_> = (0..40).map(|_| data(&mut socket, &mut now_ns)).collect();
    for (subscription, log_time_ns, message) in &messages {
        let stamp = match subscription {
            70 => {
                let arrived_ns = message["arrived_unix_s"].as_f64().unwrap() * 1e9;
                assert!((arrived_ns - *log_time_ns as f64).abs() < 1000.0, "{message}");
                continue;
            }
            71 => &message["deletions"][0]["timestamp"],
            72 | 73 => &message["timestamp"],
            other => panic!("nobody asked for {other}"),
        };
        // They are stamped with when they were scanned, which is before they came, as far as is known.
        let stamp_ns = stamp["sec"].as_u64().unwrap() * 1_000_000_000 + stamp["nsec"].as_u64().unwrap();
        assert!((log_time_ns - 1_000_000_000..log_time_ns + 5_000_000).contains(&stamp_ns), "{message}");
    }
    for wanted in 70..74 {
        assert!(messages.iter().any(|(subscription, ..)| *subscription == wanted), "{wanted}");
    }
    // Less from now on; what was on its way may still come.
    say(&mut socket, &json!({"op": "unsubscribe", "subscriptionIds": [70, 71, 72]}));
    let last: Vec<_> = (0..600).map(|_| data(&mut socket, &mut now_ns).0).collect();
    assert!(last[500..].iter().all(|subscription| *subscription == 73), "{last:?}");
    // What there is not is said, and ends nothing.
    say(&mut socket, &json!({"op": "unsubscribe", "subscriptionIds": [73]}));
    say(&mut socket, &json!({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}));
    let status = json(&mut socket);
    assert!(status["op"] == "status" && status["message"].as_str().unwrap().contains("99"), "{status}");
    live.child.kill().unwrap();
    live.end();
}

#[test]
fn an_app_is_told_once_a_second_where_detectors_are_on_a_body() {
    let body = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/bodies/hand.toml");
    let mut live = Live::of(&["--body", body, "--json", "--foxglove", "0", "--seconds", "60"]);
    let (mut socket, _) = connect(&live.told("open ws://"), "foxglove.websocket.v1").unwrap();
    let _info = json(&mut socket);
    let advertised = json(&mut socket);
    let is_transform = |channel: &&Value| channel["schemaName"] == "foxglove.FrameTransform";
    let channels: Vec<_> = advertised["channels"].as_array().unwrap().iter().filter(is_transform).collect();
    let topics: Vec<_> = channels.iter().map(|channel| channel["topic"].as_str().unwrap()).collect();
    let fingers = ["thumb", "index", "middle", "ring", "little"];
    assert_eq!(topics, fingers.map(|finger| format!("/tactomo/{finger}/tf")));
    let subscriptions: Vec<_> =
        channels.iter().zip(0..).map(|(c, id)| json!({"id": id, "channelId": c["id"]})).collect();
    say(&mut socket, &json!({"op": "subscribe", "subscriptions": subscriptions}));
    let (mut times_ns, mut count) = ([0; 5], 0);
    while count < 15 {
        let Message::Binary(bytes) = socket.read().unwrap() else { continue };
        // The time is told too.
        if bytes[0] != 1 {
            continue;
        }
        let (finger, log_time_ns, transform) = datum(&bytes);
        let finger = finger as usize;
        assert_eq!([&transform["parent_frame_id"], &transform["child_frame_id"]], ["body", fingers[finger]]);
        let before_ns = std::mem::replace(&mut times_ns[finger], log_time_ns);
        assert!(log_time_ns - before_ns >= 1_000_000_000, "{before_ns} {log_time_ns}");
        count += 1;
    }
    live.child.kill().unwrap();
    live.end();
}

#[test]
fn pages_of_other_sites_are_refused_and_connections_that_say_nothing_end() {
    let args = [
        "--json",
        "--solver",
        "tikhonov",
        "--foxglove",
        "0",
        "--allow-origin",
        "https://robot.example",
        "--seconds",
        "60",
    ];
    let mut live = Live::start(&args);
    let at = live.told("open ws://");
    let status = |origin| match connect_from(&at, "foxglove.websocket.v1", origin) {
        Ok((_, answer)) => answer.status().to_string(),
        Err(error) => error,
    };
    for origin in [None, Some("https://app.foxglove.dev"), Some("https://robot.example")] {
        assert!(status(origin).starts_with("101"), "{origin:?}");
    }
    for origin in
        ["https://evil.example", "null", "http://127.0.0.1:8765", "https://app.foxglove.dev.evil.example", "file://"]
    {
        assert!(status(Some(origin)).contains("403"), "{origin}");
    }
    let mut idle = TcpStream::connect(&at).unwrap();
    idle.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let mut bytes = Vec::new();
    assert!(idle.read_to_end(&mut bytes).is_ok(), "it is hung up on");
    live.child.kill().unwrap();
    live.end();
}

#[test]
fn other_subprotocols_are_refused_and_the_end_is_told() {
    let mut live = Live::start(&["--json", "--foxglove", "0", "--seconds", "4"]);
    let at = live.told("open ws://");
    let refused = connect(&at, "chat").unwrap_err();
    assert!(refused.contains("400"), "{refused}");
    let (mut socket, _) = connect(&at, "foxglove.websocket.v1").unwrap();
    let is_closed = |message| matches!(message, Ok(Message::Close(_)));
    while !is_closed(socket.read()) {}
    assert_eq!(live.end().0, Some(0));
}
