//! The library of plug-ins.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::StatusCode;

use super::super::access::Admin;
use super::super::extract::Segments;
use super::super::limits::{PLUGIN_BYTES, UPLOAD_PACE};
use super::super::problem::{Problem, Refused};
use super::super::upload;
use super::{Answer, At};
use crate::Gateway;
use crate::view::{PluginRef, PluginView};

/// All plug-ins
#[utoipa::path(get, operation_id = "plugin_list", path = "/plugins",
    tag = "plug-ins",
    responses((status = OK, body = Vec<PluginView>), Refused))]
pub(super) async fn list(State(app): At) -> Answer<Json<Vec<PluginView>>> {
    app.ask(Gateway::plugins).await.map(Json)
}

/// Check a module and add it
///
/// An admin's.
#[utoipa::path(post, operation_id = "plugin_add", path = "/plugins",
    tag = "plug-ins",
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = CREATED, body = PluginView), Refused))]
pub(super) async fn add(
    _: Admin,
    State(app): At,
    body: Body,
) -> Answer<(StatusCode, Json<PluginView>)> {
    let _slot = app.upload_slot()?;
    let gateway = app.gateway.clone();
    let most = app.limits.upload_bytes.min(PLUGIN_BYTES);
    let added = upload::receive(body, UPLOAD_PACE, most, move |body| {
        let mut module = Vec::new();
        body.read_to_end(&mut module).map_err(|_| Problem::bad("the body broke off"))?;
        Ok(gateway.add_plugin(&module)?)
    });
    Ok((StatusCode::CREATED, Json(added.await?)))
}

/// Remove a plug-in that no link runs
///
/// An admin's.
#[utoipa::path(delete, operation_id = "plugin_remove", path = "/plugins/{plugin}",
    tag = "plug-ins",
    params(("plugin" = String, Path, description = "`name@version` or `name@sha256:…`")),
    responses((status = NO_CONTENT), Refused))]
pub(super) async fn remove(
    _: Admin,
    State(app): At,
    Segments(plugin): Segments<String>,
) -> Answer<StatusCode> {
    app.ask(move |gateway| gateway.remove_plugin(&plugin)).await.map(|()| StatusCode::NO_CONTENT)
}

/// Remove modules that nothing refers to
///
/// An admin's.
#[utoipa::path(post, operation_id = "plugin_collect_garbage", path = "/plugins/collect-garbage",
    tag = "plug-ins",
    responses((status = OK, body = Vec<PluginRef>), Refused))]
pub(super) async fn collect_garbage(_: Admin, State(app): At) -> Answer<Json<Vec<PluginRef>>> {
    app.ask(Gateway::collect_garbage).await.map(Json)
}
