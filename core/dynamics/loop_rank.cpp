// G of closed loops, and which of its rows are independent (docs/mathematics/loops.md, 2).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/loop_pass.hpp"
#include "core/dynamics/part.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
void LoopPass::matrix() {
  const Inputs still = at_rest();
  for (const Loop& loop : loops_.all)
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      double* row = k_.G.data() + at(i) * at(m_.nv);
      std::fill_n(row, m_.nv, 0.0);
      if (loop.closing == Closing::coupling) {
        add_gradient(loop, 1.0, row);
        continue;
      }
      Inputs in = still;
      in.wrenches = wrenches_of(loop, k_.W[at(i)]);
      S_.ground(m_, ws_, in);
      S_.at_rest(m_, ws_);
      S_.node_wrenches(m_, ws_, in);
      for (auto run = k_.near.rbegin(); run != k_.near.rend(); ++run) S_.gather(m_, ws_, in, *run, k_.response.data());
      for (const int v : loop.rates) row[v] = -k_.response[at(v)];  // no other component moves the ends against each other
    }
}

void LoopPass::find_rank() {
  const int rows = loops_.rows, n = static_cast<int>(k_.columns.size());
  for (const Loop& loop : loops_.all) {
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      k_.scale[at(i)] = in_metres(loop, i);
      for (int j = 0; j < n; ++j) {
        const auto v = at(k_.columns[at(j)]);
        const bool held = m_.has_prescribed() && m_.prescribed[v] != 0;
        k_.B[at(i * n + j)] = held ? 0.0 : k_.G[at(i) * at(m_.nv) + v] * k_.scale[at(i)] * loops_.column_scale[v] / loop.reference;
      }
      k_.row_at[at(i)] = i;
    }
  }
  for (int j = 0; j < n; ++j) k_.column_at[at(j)] = j;
  const double limit = k_.dependent = std::max(loops_.dependent, more_than_dependent(open()));
  const auto B = [&](int i, int j) -> double& { return k_.B[at(k_.row_at[at(i)] * n + k_.column_at[at(j)])]; };
  const auto largest = [&](int i) { return std::abs(k_.B[at(k_.row_at[at(i)] * n + k_.largest_of[at(k_.row_at[at(i)])])]); };
  const auto look_along = [&](int i, int p) {  // of alike entries the first one
    const double* row = k_.B.data() + k_.row_at[at(i)] * n;
    int column = k_.column_at[at(p)];
    double most = -1.0;
    for (auto j = k_.column_at.begin() + p; j != k_.column_at.end(); ++j)
      if (const double x = std::abs(row[*j]); x > most) most = x, column = *j;
    k_.largest_of[at(k_.row_at[at(i)])] = column;
  };
  k_.rank = 0, k_.smallest = 0.0, k_.largest = 0.0;
  for (int i = 0; i < rows && n > 0; ++i) look_along(i, 0);
  for (int p = 0; p < std::min(rows, n); ++p) {
    int row = p;
    double most = -1.0;
    for (int i = p; i < rows; ++i)
      if (const double x = largest(i); x > most) most = x, row = i;
    if (!(most > (p < loops_.rank ? kDependent : limit))) {
      k_.largest = most;
      break;
    }
    const auto column = std::ranges::find(k_.column_at, k_.largest_of[at(k_.row_at[at(row)])]);
    const int moved = k_.column_at[at(p)];
    std::swap(k_.row_at[at(p)], k_.row_at[at(row)]);
    std::swap(k_.column_at[at(p)], *column);
    for (int i = p + 1; i < rows; ++i) {
      const double factor = B(i, p) / B(p, p);
      B(i, p) = factor;  // L, beside what is left
      if (factor != 0.0)
        for (int j = p + 1; j < n; ++j) B(i, j) -= factor * B(p, j);
      const bool moves = k_.largest_of[at(k_.row_at[at(i)])] == moved && largest(i) > 0.0;
      if (p + 1 < n && (factor != 0.0 || moves)) look_along(i, p + 1);
    }
    k_.smallest = most;
    ++k_.rank;
  }
}

LoopRank loop_rank(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives) {
  stand(model, ws, q, false);
  const Inputs in{.q = q, .v = ws.loops->zero.data(), .gravity = false, .drives = drives};
  LoopPass pass(model, ws, in);
  pass.place();
  pass.matrix();
  pass.find_rank();
  const LoopWork& work = *ws.loops;
  Eigen::MatrixXd A(model.loops.rows, static_cast<Eigen::Index>(work.columns.size()));  // scaled as find_rank() does
  for (const Loop& loop : model.loops.all)
    for (int i = loop.first; i < loop.first + loop.rows; ++i)
      for (Eigen::Index j = 0; j < A.cols(); ++j) {
        const auto v = static_cast<std::size_t>(work.columns[static_cast<std::size_t>(j)]);
        if (model.has_prescribed() && model.prescribed[v] != 0)
          A(i, j) = 0.0;
        else
          A(i, j) =
              work.G[static_cast<std::size_t>(i * model.nv) + v] * pass.in_metres(loop, i) * model.loops.column_scale[v] / loop.reference;
      }
  const double distance = work.rank > 0 ? singular_values(A)[work.rank - 1] : 0.0;
  return {model.loops.rows, work.rank, {work.row_at.begin() + work.rank, work.row_at.end()}, work.smallest, work.largest, distance};
}

void tell_singular_posture(const Model& model, const soa::Breakdown& bad, double t, const double* q, const LoopDrive* drives,
                           RunFailure& failure) {
  if (bad.row < 0) return;
  Workspace ws(model);
  make_room_for_loops(model, ws);
  const LoopRank rank = loop_rank(model, ws, q, drives);
  const bool fewer = rank.rank < model.loops.rank && !holds_loops(model, *ws.loops);
  if (!fewer && std::ranges::find(rank.redundant, bad.row) != rank.redundant.end()) {
    failure.what += ", and other rows imply it";
    failure.hint =
        "what these loops hold contradicts itself there: more digits of lengths, places and axes, as far as they are typed, or types "
        "that hold less (`cardan describe` names what could be set free)";
    return;
  }
  const double pivot = fewer ? rank.largest : rank.smallest;
  if (!(pivot < kNearSingular)) return;
  const Loop& loop = *std::ranges::find_if(model.loops.all, [&](const Loop& l) { return bad.row < l.first + l.rows; });
  std::string at;
  for (const UserBody& u : model.user)
    for (int i = 0; i < u.nv && u.nq == u.nv; ++i)
      if (const auto k = static_cast<std::size_t>(i); std::ranges::binary_search(loop.rates, u.v + i))
        at += fmt::format("{}{}.{} = {:.6g} {}", at.empty() ? "" : ", ", u.name, u.q_names[k], q[u.q + i], u.q_units[k]);
  failure.what +=
      fmt::format(", at a singular posture: a scaled pivot of {:.2g} at t = {:.6g} s{}{}", pivot, t, at.empty() ? "" : ", ", at);
  failure.hint =
      "a row of the loops holds nothing there, and a step ended there, for a row of output, a tick, an event or a change of the "
      "vehicle: let that fall beside it (`between_steps` of `output` ends no step for rows). Loops that begin or rest there have no way "
      "of their own";
}

Eigen::MatrixXd loop_matrix(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives) {
  loop_rank(model, ws, q, drives);
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(ws.loops->G.data(), model.loops.rows,
                                                                                                  model.nv);
}

LoopRows loop_rows(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives) {
  stand(model, ws, q, false);
  const Inputs in{.q = q, .v = ws.loops->zero.data(), .gravity = false, .drives = drives};
  LoopPass pass(model, ws, in);
  pass.place();
  pass.matrix();
  LoopRows out{Eigen::VectorXd(model.loops.rows), Eigen::MatrixXd(model.loops.rows, model.nv)};
  for (const Loop& loop : model.loops.all)
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      const double unit = pass.in_metres(loop, i) / pass.size_of(loop);
      out.c[i] = unit * ws.loops->c[static_cast<std::size_t>(i)];
      out.G.row(i) = unit * Eigen::Map<const Eigen::RowVectorXd>(ws.loops->G.data() + i * model.nv, model.nv);
    }
  return out;
}

void require_regular_posture(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives, const Eigen::VectorXd& v) {
  std::vector<LoopDrive> held(static_cast<std::size_t>(drives ? model.loops.n_drives : 0));
  for (std::size_t i = 0; i < held.size(); ++i) held[i].more = drives[i].more;  // lengths as they are, at rest as v has them
  const Eigen::VectorXd still = Eigen::VectorXd::Zero(model.nv);
  Eigen::VectorXd vdot(model.nv);
  const Inputs in{
      .q = q, .v = v.data(), .tau = still.data(), .vdot = still.data(), .gravity = false, .drives = drives ? held.data() : nullptr};
  if (forward_dynamics(model, ws, in, vdot.data())) return;
  RunFailure failure = describe_breakdown(model, ws.breakdown, 0.0);
  if (ws.breakdown.row >= 0) failure.hint = "a singular posture: loops leave motions free that cannot all go on. Ask beside it";
  throw NumericsError(std::move(failure));
}

Eigen::VectorXd some_rates(int which, Eigen::Index n) {
  Eigen::VectorXd out(n);
  for (Eigen::Index j = 0; j < n; ++j) out[j] = std::cos((which == 0 ? 0.7 : 2.9) + 2.3 * static_cast<double>(j));
  return out;
}

LoopFreedom loop_freedom(const Model& model, Workspace& ws, const double* q, const LoopDrive* drives) {
  const Eigen::MatrixXd G = loop_matrix(model, ws, q, drives);
  const LoopWork& work = *ws.loops;
  LoopFreedom out;
  out.rows.assign(work.row_at.begin(), work.row_at.begin() + work.rank);
  for (int p = 0; p < work.rank; ++p)
    out.dependent.push_back(work.columns[static_cast<std::size_t>(work.column_at[static_cast<std::size_t>(p)])]);
  for (int v = 0; v < model.nv; ++v)
    if (std::ranges::find(out.dependent, v) == out.dependent.end()) out.independent.push_back(v);
  out.G_D_inverse = inverse(Eigen::MatrixXd(G(out.rows, out.dependent)));
  out.X.setZero(model.nv, static_cast<Eigen::Index>(out.independent.size()));
  for (std::size_t j = 0; j < out.independent.size(); ++j) out.X(out.independent[j], static_cast<Eigen::Index>(j)) = 1.0;
  const Eigen::MatrixXd of_dependent = -out.G_D_inverse * G(out.rows, out.independent);
  for (std::size_t i = 0; i < out.dependent.size(); ++i) out.X.row(out.dependent[i]) = of_dependent.row(static_cast<Eigen::Index>(i));
  for (int i = 0; i < 2 && work.rank < model.loops.rows; ++i)
    require_regular_posture(model, ws, q, drives, out.X * some_rates(i, out.X.cols()));
  return out;
}

std::string name_of_row(const Loop& loop, int row, const Force<double>& W) {
  if (loop.rows == 1) return loop.name;
  const bool turns = dot(W.n, W.n) > dot(W.f, W.f);
  const Vec3<double> u = turns ? W.n : W.f;
  const double x = std::abs(u.x), y = std::abs(u.y), z = std::abs(u.z);
  const char* axis = x >= y && x >= z ? "x" : y >= z ? "y" : "z";
  return fmt::format("{}: row {}, {} {}", loop.name, row - loop.first + 1, turns ? "rotation about" : "along", axis);
}

const char* unit_of_row(const Loop& loop, const Force<double>& W) {
  return loop.closing == Closing::coupling ? "" : dot(W.n, W.n) > dot(W.f, W.f) ? " rad" : " m";
}

std::string name_of_row(const Model& model, const Workspace& ws, int row) {
  for (const Loop& loop : model.loops.all)
    if (row < loop.first + loop.rows) return name_of_row(loop, row, ws.loops->W[static_cast<std::size_t>(row)]);
  return {};
}

}  // namespace cardan
