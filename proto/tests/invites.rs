//! Invites as they are written down and read again.

use proptest::prelude::*;
use teleclay_proto::invite::{Fingerprint, InviteError, InviteId, InviteLine, InviteToken, Role};
use teleclay_proto::{RealmName, SessionId};

fn line() -> InviteLine {
    InviteLine {
        endpoint: "tls/[2001:db8::7]:7547".to_owned(),
        realm: RealmName::new("local").unwrap(),
        session: SessionId::new("demo").unwrap(),
        fingerprint: Some(Fingerprint::new([0xab; 32])),
        token: InviteToken::new(InviteId::new(0x1a), [7; 16]),
    }
}

#[test]
fn a_line_is_what_the_description_says() {
    let expected = format!(
        "teleclay:tls/[2001:db8::7]:7547,local,demo,{},0000001a.{}",
        "ab".repeat(32),
        "07".repeat(16)
    );
    assert_eq!(line().to_string(), expected);
    // As it is copied from a terminal.
    assert_eq!(format!(" {expected}\n").parse(), Ok(line()));
}

#[test]
fn what_is_no_invite_is_refused_without_repeating_the_secret() {
    let good = line().to_string();
    let secret = "07".repeat(16);
    for bad in [
        good.replace("teleclay:", ""),
        good.replace("demo", "De mo"),
        good.replace("abab", "xyxy"),
        good.replace("0000001a", "1a"),
        good.replace("0707", "07"),
        good.replace("07070707", "0707070G"),
        format!("{good},more"),
        good.replace("tls/[2001:db8::7]:7547", ""),
        good.replace(',', " "),
        "x".repeat(5000),
    ] {
        let error = bad.parse::<InviteLine>().unwrap_err();
        assert!(!error.to_string().contains(&secret), "{error}");
    }
    assert_eq!("".parse::<InviteLine>(), Err(InviteError::Line));
    assert!(!format!("{:?}", line()).contains(&secret));
}

#[test]
fn each_role_may_do_what_the_one_before_it_may() {
    assert!(Role::Spectator < Role::Operator && Role::Operator < Role::Admin);
}

#[test]
fn fingerprints_are_read_as_other_programs_print_them() {
    let colons = vec!["AB"; 32].join(":");
    assert_eq!(colons.parse(), Ok(Fingerprint::new([0xab; 32])));
    assert!("ab".parse::<Fingerprint>().is_err());
}

proptest! {
    #[test]
    fn what_is_written_is_read_again(number: u32, secret: [u8; 16], print: Option<[u8; 32]>) {
        let written = InviteLine {
            fingerprint: print.map(Fingerprint::new),
            token: InviteToken::new(InviteId::new(number), secret),
            ..line()
        };
        prop_assert_eq!(written.to_string().parse(), Ok(written));
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in ".*", tail in "[a-f0-9,.:/-]*") {
        let _ = text.parse::<InviteLine>();
        let _ = format!("teleclay:{tail}").parse::<InviteLine>();
        let _ = tail.parse::<InviteToken>();
        let _ = tail.parse::<Fingerprint>();
    }
}
