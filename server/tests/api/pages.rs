//! What browsers see: the dashboard, the documentation, the catalogue of problems; and what monitoring sees.

use std::collections::BTreeSet;

use crate::rig::shared;
use crate::wire::Ask;

const PAGES: [&str; 4] = ["/", "/api/docs/", "/problems", "/problems/field"];

#[test]
fn every_answer_says_how_far_it_may_be_trusted() {
    let site = shared().site();
    let asks = PAGES
        .into_iter()
        .chain([
            "/healthz",
            "/metrics",
            "/api/v1/sessions",
            "/nothing",
            "/api/v1/openapi.json",
        ])
        .map(|path| Ask::new("GET", path))
        .chain([
            Ask::new("PUT", "/"),
            Ask::new("POST", "/api/v1/sessions").json("{"),
            Ask::new("GET", "/").with("Host", "evil.example"),
        ]);
    for ask in asks {
        let answer = site.send(&ask);
        assert_eq!(
            answer.header("x-content-type-options"),
            Some("nosniff"),
            "{ask:?}"
        );
        assert_eq!(answer.header("x-frame-options"), Some("DENY"), "{ask:?}");
        assert_eq!(
            answer.header("referrer-policy"),
            Some("no-referrer"),
            "{ask:?}"
        );
        assert_eq!(
            answer.header("cross-origin-resource-policy"),
            Some("same-origin")
        );
        let policy = answer.header("content-security-policy").unwrap();
        assert!(policy.starts_with("default-src 'none'"), "{policy}");
        assert!(policy.contains("frame-ancestors 'none'"), "{policy}");
        assert!(
            // A module of WebAssembly may be compiled; no text becomes a script.
            !policy.contains("'unsafe-eval'") && !policy.contains("http"),
            "{policy}"
        );
        assert!(answer.header("cache-control").is_some(), "{ask:?}");
        assert!(answer.header("content-type").is_some(), "{ask:?}");
    }
}

#[test]
fn pages_are_pages_and_load_nothing_from_elsewhere() {
    let site = shared().site();
    for path in PAGES {
        let page = site.get(path);
        assert_eq!(page.status, 200, "{path}");
        assert!(
            page.header("content-type")
                .unwrap()
                .starts_with("text/html"),
            "{path}"
        );
        for outside in [
            "src=\"http",
            "href=\"http",
            "src=\"//",
            "href=\"//",
            "url(http",
        ] {
            assert!(!page.text().contains(outside), "{path} has {outside}");
        }
    }
}

#[test]
fn the_documentation_is_whole_and_points_at_this_server() {
    let site = shared().site();
    let redirect = site.get("/api/docs");
    assert_eq!(
        (redirect.status, redirect.header("location")),
        (308, Some("docs/"))
    );
    let page = site.get("/api/docs/");
    let text = page.text().to_owned();
    let parts: BTreeSet<&str> = text
        .split(['"', '\''])
        .filter(|part| {
            [".js", ".css", ".png"]
                .iter()
                .any(|end| part.ends_with(end))
        })
        .collect();
    assert!(4 <= parts.len(), "{parts:?}");
    for part in parts {
        let path = format!("/api/docs/{}", part.trim_start_matches("./"));
        let answer = site.get(&path);
        assert_eq!(answer.status, 200, "{path}");
        assert!(!answer.body.is_empty(), "{path}");
        let kind = answer.header("content-type").unwrap();
        assert!(!kind.starts_with("text/html"), "{path} is {kind}");
    }
    let start = site.get("/api/docs/swagger-initializer.js");
    assert!(
        start.text().contains("../v1/openapi.json"),
        "{}",
        start.text()
    );
    assert!(
        start.text().contains("\"validatorUrl\": \"none\""),
        "{}",
        start.text()
    );
}
