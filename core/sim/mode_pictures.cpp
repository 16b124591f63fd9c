#include "core/sim/mode_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace cardan {
namespace {

constexpr std::size_t kMostPoints = 500, kMostModes = 30;

void append(std::vector<double>& to, const Eigen::MatrixXd& rows) {
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    for (Eigen::Index k = 0; k < rows.cols(); ++k) to.push_back(rows(i, k));
}

/// Mass nodes, evenly thinned where they are many, and the nodes with names.
ModalDrawing drawing_of_nodes(const ModalData& modal) {
  std::vector<Eigen::Vector3d> points;
  std::vector<const Eigen::MatrixXd*> Phi;
  const std::size_t stride = modal.mass_nodes.size() / kMostPoints + 1;
  for (std::size_t i = 0; i < modal.mass_nodes.size(); i += stride) {
    points.push_back(modal.mass_nodes[i].position);
    Phi.push_back(&modal.mass_nodes[i].Phi);
  }
  for (std::size_t i = 0; i < std::min(modal.nodes.size(), kMostPoints); ++i) {
    points.push_back(modal.nodes[i].position);
    Phi.push_back(&modal.nodes[i].Phi);
  }
  ModalDrawing out;
  out.points.setZero(static_cast<Eigen::Index>(points.size()), 3);
  out.shapes.assign(std::min(kMostModes, static_cast<std::size_t>(modal.n_modes)), out.points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    out.points.row(row) = points[i].transpose();
    if (Phi[i]->size() == 0) continue;  // does not move
    for (std::size_t j = 0; j < out.shapes.size(); ++j) out.shapes[j].row(row) = Phi[i]->col(static_cast<Eigen::Index>(j)).transpose();
  }
  return out;
}

ModePicture picture_of(const ModalData& modal) {
  const ModalDrawing drawing = modal.drawing.points.rows() > 0 ? modal.drawing : drawing_of_nodes(modal);
  ModePicture out;
  out.source = modal.source;
  append(out.points, drawing.points);
  for (Eigen::Index i = 0; i < drawing.lines.rows(); ++i)
    for (Eigen::Index k = 0; k < 2; ++k) out.lines.push_back(static_cast<std::int64_t>(drawing.lines(i, k)));
  for (std::size_t j = 0; j < drawing.shapes.size(); ++j) {
    const auto m = static_cast<Eigen::Index>(j);  // of this mode alone, where K couples several
    out.frequency.push_back(std::sqrt(modal.K(m, m) / modal.integrals.I6(m, m)) / (2.0 * std::numbers::pi));
    append(out.shapes, drawing.shapes[j]);
  }
  return out;
}

}  // namespace

std::vector<ModePicture> mode_pictures(const SystemSpec& spec) {
  std::vector<ModePicture> out;
  std::map<const ModalData*, std::size_t> known;
  for (const BodySpec& body : spec.bodies) {
    if (!body.modal) continue;
    const auto [at, is_new] = known.emplace(body.modal.get(), out.size());
    if (is_new) out.push_back(picture_of(*body.modal));
    out[at->second].bodies.push_back(body.name);
  }
  return out;
}

}  // namespace cardan
