//! Two hosts on one machine: network namespaces with a cable of two virtual Ethernet devices between them.
//!
//! They take root and `ip`; where either is missing, [`Pair::make`] says so and the test that wanted them has nothing
//! to test.

use std::fs::File;
use std::io::Read as _;
use std::net::Ipv4Addr;
use std::os::fd::AsRawFd;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context as _, Result, ensure};
use socket2::{Domain, Protocol, Socket, Type};

/// Address of the server's end.
pub const SERVER: Ipv4Addr = Ipv4Addr::new(10, 77, 0, 1);
/// Address of the handle's end.
pub const HANDLE: Ipv4Addr = Ipv4Addr::new(10, 77, 0, 2);

/// What crosses no cable has no addresses of devices.
const OF_LOOPBACK: [u8; 12] = [0; 12];

/// Two namespaces and the cable; gone when dropped.
#[derive(Debug)]
pub struct Pair {
    server: String,
    handle: String,
}

impl Pair {
    /// Makes them.
    ///
    /// # Errors
    /// This machine does not allow it: no `ip`, no rights, no such devices.
    pub fn make() -> Result<Self> {
        let name = |end| format!("teleclay-{}-{end}", std::process::id());
        let pair = Self {
            server: name("s"),
            handle: name("h"),
        };
        // Names of devices have fifteen letters at most.
        let device = |end| format!("tc{}{end}", std::process::id() % 1_000_000);
        let [ours, theirs] = [device("s"), device("h")];
        ip(&["netns", "add", &pair.server])?;
        ip(&["netns", "add", &pair.handle])?;
        ip(&[
            "link",
            "add",
            &ours,
            "netns",
            &pair.server,
            "type",
            "veth",
            "peer",
            "name",
            &theirs,
            "netns",
            &pair.handle,
        ])?;
        for (namespace, device, address) in [
            (&pair.server, &ours, SERVER),
            (&pair.handle, &theirs, HANDLE),
        ] {
            let address = format!("{address}/24");
            ip(&["-n", namespace, "address", "add", &address, "dev", device])?;
            ip(&["-n", namespace, "link", "set", device, "up"])?;
            ip(&["-n", namespace, "link", "set", "lo", "up"])?;
        }
        Ok(pair)
    }

    /// Runs `work` on a thread of its own at the server's end: what it opens and starts is there.
    ///
    /// # Errors
    /// The thread cannot go there.
    ///
    /// # Panics
    /// When `work` does.
    pub fn at_the_server<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T> {
        std::thread::scope(|scope| {
            let there = scope.spawn(|| {
                enter(&self.server)?;
                Ok(work())
            });
            match there.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    }

    /// Everything that comes over the cable from now on, as it crosses, at the server's end.
    ///
    /// # Errors
    /// The thread cannot go there, or has no right to listen.
    pub fn overhear(&self) -> Result<Overheard> {
        let socket = self.at_the_server(|| {
            let every = (libc::ETH_P_ALL as u16).to_be();
            let protocol = Some(Protocol::from(i32::from(every)));
            Socket::new(Domain::PACKET, Type::RAW, protocol)
        })??;
        socket.set_recv_buffer_size(32 << 20)?;
        socket.set_read_timeout(Some(Duration::from_millis(100)))?;
        let over = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            let (mut socket, mut packets) = (socket, Vec::new());
            let mut packet = vec![0; 1 << 17];
            while !stop.load(Ordering::Relaxed) {
                // Nothing for a while is nothing yet.
                if let Ok(length) = socket.read(&mut packet)
                    && packet[..12] != OF_LOOPBACK
                {
                    packets.push(packet[..length].to_vec());
                }
            }
            packets
        });
        Ok(Overheard { over, thread })
    }

    /// A command that runs `program` at the handle's end.
    pub fn at_the_handle(&self, program: &PathBuf) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.handle]).arg(program);
        command
    }
}

/// Somebody who listens at the cable.
#[derive(Debug)]
pub struct Overheard {
    over: Arc<AtomicBool>,
    thread: JoinHandle<Vec<Vec<u8>>>,
}

impl Overheard {
    /// Ends it, and gives every packet, its Ethernet header first.
    ///
    /// # Panics
    /// The thread has.
    pub fn packets(self) -> Vec<Vec<u8>> {
        self.over.store(true, Ordering::Relaxed);
        self.thread.join().expect("it only reads")
    }
}

impl Drop for Pair {
    fn drop(&mut self) {
        // The cable goes with the namespaces. What cannot be removed is only untidy.
        for name in [&self.server, &self.handle] {
            let _ = ip(&["netns", "delete", name]);
        }
    }
}

fn ip(arguments: &[&str]) -> Result<()> {
    let output = Command::new("ip")
        .args(arguments)
        .output()
        .context("`ip` cannot be started")?;
    ensure!(
        output.status.success(),
        "ip {}: {}",
        arguments.join(" "),
        String::from_utf8_lossy(&output.stderr).trim()
    );
    Ok(())
}

fn enter(namespace: &str) -> Result<()> {
    let file = File::open(format!("/var/run/netns/{namespace}"))?;
    #[allow(
        unsafe_code,
        reason = "std has no namespaces; setns(2) takes a descriptor, which is ours and open"
    )]
    // SAFETY: see the reason. It changes this thread alone.
    let refused = unsafe { libc::setns(file.as_raw_fd(), libc::CLONE_NEWNET) };
    ensure!(
        refused == 0,
        "cannot enter {namespace}: {}",
        std::io::Error::last_os_error()
    );
    Ok(())
}
