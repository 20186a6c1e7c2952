//! The interface from outside: a real server in this process, requests over loopback connections.

mod answers;
mod bodies;
mod burdens;
mod calls;
mod connection;
mod dashboards;
mod description;
mod ending;
mod foxglove;
mod guard;
mod hand;
mod import;
mod layouts;
mod limits;
mod metrics;
mod model;
mod pages;
mod rig;
mod routes;
mod schema;
mod stream;
mod theory;
mod urgent;
mod visitor;
mod wire;
