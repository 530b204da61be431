//! Cells: links that work together.

use axum::Json;
use axum::extract::State;

use super::super::extract::{Document, Segments};
use super::super::problem::Refused;
use super::{Answer, At};
use crate::Gateway;
use crate::view::{CellView, ForceOrder, ModeOrder};

/// All cells, in the order of their names
#[utoipa::path(get, operation_id = "cell_list", path = "/cells",
    tag = "cells",
    responses((status = OK, body = Vec<CellView>), Refused))]
pub(super) async fn list(State(app): At) -> Answer<Json<Vec<CellView>>> {
    app.ask(Gateway::cells).await.map(Json)
}

/// One cell
#[utoipa::path(get, operation_id = "cell_show", path = "/cells/{cell}",
    tag = "cells",
    params(("cell" = String, Path, description = "Name of the cell")),
    responses((status = OK, body = CellView), Refused))]
pub(super) async fn show(
    State(app): At,
    Segments(cell): Segments<String>,
) -> Answer<Json<CellView>> {
    app.ask(move |gateway| gateway.cell(&cell)).await.map(Json)
}

/// Give an axis to a channel, whoever has it
///
/// Who loses it is interrupted, and gets it back before all others.
#[utoipa::path(post, operation_id = "cell_force", path = "/cells/{cell}/axes/{axis}/force",
    tag = "cells",
    params(("cell" = String, Path, description = "Name of the cell"),
        ("axis" = String, Path, description = "Name of the axis")),
    request_body = ForceOrder,
    responses((status = OK, body = CellView), Refused))]
pub(super) async fn force(
    State(app): At,
    Segments((cell, axis)): Segments<(String, String)>,
    Document(order): Document<ForceOrder>,
) -> Answer<Json<CellView>> {
    app.ask(move |gateway| gateway.force_axis(&cell, &axis, &order.channel)).await.map(Json)
}

/// Make an axis neutral, whoever has it
///
/// The next in its queue gets it. A program that had it is interrupted until it has it back.
#[utoipa::path(post, operation_id = "cell_release", path = "/cells/{cell}/axes/{axis}/release",
    tag = "cells",
    params(("cell" = String, Path, description = "Name of the cell"),
        ("axis" = String, Path, description = "Name of the axis")),
    responses((status = OK, body = CellView), Refused))]
pub(super) async fn release(
    State(app): At,
    Segments((cell, axis)): Segments<(String, String)>,
) -> Answer<Json<CellView>> {
    app.ask(move |gateway| gateway.release_axis(&cell, &axis)).await.map(Json)
}

/// Choose the mode of a group of channels
#[utoipa::path(post, operation_id = "cell_mode", path = "/cells/{cell}/groups/{group}/mode",
    tag = "cells",
    params(("cell" = String, Path, description = "Name of the cell"),
        ("group" = String, Path, description = "Name of the group")),
    request_body = ModeOrder,
    responses((status = OK, body = CellView), Refused))]
pub(super) async fn mode(
    State(app): At,
    Segments((cell, group)): Segments<(String, String)>,
    Document(order): Document<ModeOrder>,
) -> Answer<Json<CellView>> {
    app.ask(move |gateway| gateway.set_mode(&cell, &group, order.mode)).await.map(Json)
}

/// Let programs begin again after a crash
#[utoipa::path(post, operation_id = "cell_clear", path = "/cells/{cell}/clear",
    tag = "cells",
    params(("cell" = String, Path, description = "Name of the cell")),
    responses((status = OK, body = CellView), Refused))]
pub(super) async fn clear(
    State(app): At,
    Segments(cell): Segments<String>,
) -> Answer<Json<CellView>> {
    app.ask(move |gateway| gateway.clear_cell(&cell)).await.map(Json)
}
