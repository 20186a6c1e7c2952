//! What the interface is told when it starts.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

use teleclay_proto::NodeName;
use teleclay_ros2::Status;

use crate::doors::Doors;

/// How the interface behaves. What may be configured by people is checked by whoever reads their configuration.
#[derive(Clone, Debug)]
pub struct ApiConfig {
    /// What callers must show. Doors that are open let everyone in who reaches the listening address, which must then
    /// be a loopback address. To pass through a browser's WebSocket a token may only have the characters of an HTTP
    /// token, RFC 9110 §5.6.2.
    pub doors: Arc<Doors>,
    /// Origins, such as `https://lab.example`, whose pages may use the interface besides those that the server serves
    /// itself. Compared as they are.
    pub allowed_origins: Vec<String>,
    /// Where the server listens.
    pub listen: SocketAddr,
    /// The server's name.
    pub node: NodeName,
    /// The server's version.
    pub version: String,
    /// When the process started.
    pub started: Instant,
    /// How it goes on ROS 2, where sessions are told of there.
    pub ros2: Option<Arc<Status>>,
}
