//! The interface to browse and to try, at `/api/docs`. Every file comes from the program itself.

use std::sync::Arc;

use axum::Router;
use axum::extract::Path;
use axum::extract::rejection::PathRejection;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use utoipa_swagger_ui::{Config, Url, serve};

use super::Api;
use super::problem::{Failure, INTERNAL, NO_SUCH_PATH, path_of};

/// The page styles itself inline and has its icons in its style sheet.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
     font-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// `/api/docs` and the files below it.
pub(crate) fn routes() -> Router<Api> {
    let config = Arc::new(
        // Relative, so that the page also works below a path of a reverse proxy.
        Config::new([Url::from("../v1/openapi.json")])
            .use_base_layout()
            // The page would otherwise send the description to a checker on the internet.
            .validator_url("none")
            .doc_expansion("list")
            .default_models_expand_depth(0)
            .display_request_duration(true),
    );
    let page = Arc::clone(&config);
    Router::new()
        // A relative reference needs the slash to be resolved against.
        .route(
            "/api/docs",
            get(|| async {
                (
                    StatusCode::PERMANENT_REDIRECT,
                    [(header::LOCATION, "docs/")],
                )
            }),
        )
        .route(
            "/api/docs/",
            get(async move |uri: Uri| file("", &uri, &page)),
        )
        .route(
            "/api/docs/{*file}",
            get(
                async move |uri: Uri, path: Result<Path<String>, PathRejection>| {
                    let Path(path) = path.map_err(|rejection| {
                        NO_SUCH_PATH.because(format!(
                            "{}: {}",
                            path_of(&uri),
                            rejection.body_text()
                        ))
                    })?;
                    file(&path, &uri, &config)
                },
            ),
        )
}

fn file(path: &str, asked: &Uri, config: &Arc<Config<'static>>) -> Result<Response, Failure> {
    let found = serve(path, Arc::clone(config))
        .map_err(|error| INTERNAL.because(error.to_string()))?
        .ok_or_else(|| {
            NO_SUCH_PATH.because(format!("the documentation has no file {}", path_of(asked)))
        })?;
    let headers = [
        (header::CONTENT_TYPE, found.content_type),
        (header::CACHE_CONTROL, "no-cache".to_owned()),
        (header::CONTENT_SECURITY_POLICY, POLICY.to_owned()),
    ];
    Ok((headers, found.bytes.into_owned()).into_response())
}
