//! The interface's own description: OpenAPI 3.1, written from the routes that are served.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use teleclay_proto::http::Problem;
use teleclay_proto::watch::{ClientText, ServerText};
use utoipa::OpenApi as _;
use utoipa::openapi::example::ExampleBuilder;
use utoipa::openapi::schema::{AdditionalProperties, Schema};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{
    Components, ContentBuilder, InfoBuilder, OpenApi, Ref, RefOr, Required, Response,
    ResponseBuilder, Server,
};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::Api;
use super::problem::{
    HOST, HOST_MISSING, INTERNAL, KINDS, Kind, METHOD, NO_ANSWER, NO_SUCH_PATH, NOT_ALLOWED,
    ORIGIN, TOKEN, TOO_MANY_TRIES,
};

/// What any call may be answered with.
pub(crate) const ANYWHERE: &[Kind] = &[HOST_MISSING, HOST, ORIGIN, INTERNAL, NO_ANSWER];

/// What any call may be answered with that a token guards.
pub(crate) const GUARDED: &[Kind] = &[
    HOST_MISSING,
    TOKEN,
    HOST,
    ORIGIN,
    NOT_ALLOWED,
    TOO_MANY_TRIES,
    INTERNAL,
    NO_ANSWER,
];

/// Declares the kinds of problem that a call may be answered with, besides [`GUARDED`] or whatever follows `in`.
macro_rules! refusals {
    ($name:ident: $($kind:ident),* $(,)?) => {
        $crate::api::openapi::refusals!($name in GUARDED: $($kind),*);
    };
    ($name:ident in $everywhere:ident: $($kind:ident),* $(,)?) => {
        struct $name;

        impl utoipa::IntoResponses for $name {
            fn responses() -> std::collections::BTreeMap<
                String,
                utoipa::openapi::RefOr<utoipa::openapi::Response>,
            > {
                $crate::api::openapi::responses($crate::api::openapi::$everywhere, &[$($kind),*])
            }
        }
    };
}

pub(crate) use refusals;

refusals!(DocumentRefusals in ANYWHERE:);

#[derive(utoipa::OpenApi)]
#[openapi(
    components(schemas(Problem, ServerText, ClientText)),
    tags(
        (name = "sessions", description = "What runs, and what it is told to be"),
        (name = "clay", description = "The clay of a session"),
        (name = "operators", description = "Who holds which tool, and the stop"),
        (name = "watching", description = "A session as it happens"),
        (name = "theory", description = "The published mathematics: robot, loop, experiment"),
        (name = "probes", description = "For supervisors and monitoring"),
    ),
)]
struct Frame;

/// Calls whose body may be left out; where there is one, it is as described.
const BODIES_LEFT_OUT: [&str; 3] = ["clear_stop", "grant", "deny"];

/// The description of `calls`.
pub(crate) fn document(calls: OpenApi, version: &str) -> OpenApi {
    let mut document = Frame::openapi();
    document.merge(calls);
    if let Some(components) = &mut document.components {
        components.schemas.values_mut().for_each(close_variants);
    }
    for item in document.paths.paths.values_mut() {
        if let Some(operation) = &mut item.post
            && let Some(id) = &operation.operation_id
            && BODIES_LEFT_OUT.contains(&id.as_str())
            && let Some(RefOr::T(body)) = &mut operation.request_body
        {
            body.required = Some(Required::False);
        }
    }
    document.info = InfoBuilder::new()
        .title("teleclay")
        .version(version)
        .description(Some(description()))
        .build();
    document.servers = Some(vec![Server::new("/")]);
    let bearer = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some(
            "Only where the server has a token configured. A WebSocket may pass it as a subprotocol instead, as bearer.<token>.",
        ))
        .build();
    document
        .components
        .get_or_insert_with(Components::new)
        .add_security_scheme("token", SecurityScheme::Http(bearer));
    document.security = Some(vec![
        SecurityRequirement::default(),
        SecurityRequirement::new("token", <[&str; 0]>::default()),
    ]);
    document
}

/// Says of each object of a choice that it has no other fields. Every one is told apart by a field and refuses the
/// fields of the others; the schemas that are derived for them say so of plain objects only.
fn close_variants(schema: &mut RefOr<Schema>) {
    let RefOr::T(Schema::OneOf(choice)) = schema else {
        return;
    };
    for variant in &mut choice.items {
        if let RefOr::T(Schema::Object(object)) = variant {
            let closed = Box::new(AdditionalProperties::FreeForm(false));
            object.additional_properties.get_or_insert(closed);
        }
    }
}

/// The call that answers with the description.
pub(crate) fn routes() -> OpenApiRouter<Api> {
    OpenApiRouter::new().routes(routes!(describe))
}

/// The responses of a call, one for each status, with an example for each kind of problem.
pub(crate) fn responses(everywhere: &[Kind], own: &[Kind]) -> BTreeMap<String, RefOr<Response>> {
    let mut by_status: BTreeMap<u16, Vec<Kind>> = BTreeMap::new();
    for kind in own.iter().chain(everywhere) {
        let kinds = by_status.entry(kind.status.as_u16()).or_default();
        if !kinds.contains(kind) {
            kinds.push(*kind);
        }
    }
    by_status
        .into_iter()
        .map(|(status, kinds)| (status.to_string(), response(&kinds).into()))
        .collect()
}

/// This description
#[utoipa::path(
    get, path = "/api/v1/openapi.json", tag = "probes",
    responses((status = 200, description = "OpenAPI 3.1", content_type = "application/json"), DocumentRefusals),
    security(()),
)]
async fn describe(State(api): State<Api>) -> impl IntoResponse {
    (
        [(header::CONTENT_TYPE, "application/json")],
        api.document().clone(),
    )
}

fn response(kinds: &[Kind]) -> Response {
    let description: Vec<String> = kinds
        .iter()
        .map(|kind| format!("`{}`: {}", kind.word, kind.title))
        .collect();
    let examples = kinds.iter().map(|kind| {
        let problem = kind.because(kind.meaning).into_problem();
        let value = serde_json::to_value(problem).ok();
        (kind.word, ExampleBuilder::new().value(value).build())
    });
    let content = ContentBuilder::new()
        .schema(Some(Ref::from_schema_name("Problem")))
        .examples_from_iter(examples)
        .build();
    ResponseBuilder::new()
        .description(description.join("; "))
        .content(Problem::MEDIA_TYPE, content)
        .build()
}

fn description() -> String {
    let mut text = String::from(
        "Haptic tele-presence: a person holds a handle, a tool cuts clay that lives on this server.\n\n\
         SI units throughout; every name of a quantity ends in its unit. Bodies are JSON of at most 64 KiB; unknown fields, \
         non-finite numbers and numbers out of range are errors. Errors are problem details, RFC 9457; their type is one of \
         these, relative to the server, and does not change:\n\n| type | status | title |\n|---|---|---|\n",
    );
    for kind in KINDS {
        let Kind {
            word,
            title,
            status,
            ..
        } = kind;
        text.push_str(&format!(
            "| [`/problems/{word}`](/problems/{word}) | {} | {title} |\n",
            status.as_u16()
        ));
    }
    text.push_str(&format!(
        "\nA path that is not listed here is answered with `{}`, a method that is not with `{}`.\n",
        NO_SUCH_PATH.word, METHOD.word
    ));
    text
}
