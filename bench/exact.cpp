#include "bench/exact.hpp"

#ifdef __clang__  // no quadmath.h; the same format, slower
#include <boost/multiprecision/cpp_bin_float.hpp>
#else
#include <boost/multiprecision/float128.hpp>
#endif
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/reference/dense_dynamics.hpp"
#include "core/reference/quad.hpp"
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::bench {
namespace {

#ifdef __clang__
using Quad = boost::multiprecision::number<boost::multiprecision::cpp_bin_float_quad::backend_type, boost::multiprecision::et_off>;
#else
using Quad = boost::multiprecision::float128;
#endif
constexpr soa::Sweeps<Quad> S = soa::make_sweeps<Quad, soa::Wanted::program>();
using Vector = std::vector<Quad>;

Vector up(const Eigen::VectorXd& x) { return {x.data(), x.data() + x.size()}; }
Eigen::VectorXd down(const Vector& x) {
  Eigen::VectorXd y(static_cast<Eigen::Index>(x.size()));
  std::transform(x.begin(), x.end(), y.data(), [](const Quad& v) { return static_cast<double>(v); });
  return y;
}

Vector forward(const Model& model, const soa::Inputs<Quad>& in, bool elastic = true) {
  soa::Workspace<Quad> ws(model);
  Vector vdot(static_cast<std::size_t>(model.nv));
  S.ground(model, ws, in);
  S.hinge_records(model, ws, in);
  for (const Run& run : model.runs) S.outward(model, ws, in, run, {});
  if (elastic) S.elastic(model, ws, in);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.inward(model, ws, in, *run, {});
  for (const Run& run : model.runs) S.acceleration(model, ws, in, run, vdot.data());
  for (int i = 0; i < 2 && !model.graded.swept.empty(); ++i) S.refine(model, ws, in, vdot.data());
  return vdot;
}

Vector inverse(const Model& model, const soa::Inputs<Quad>& in, bool elastic = true) {
  soa::Workspace<Quad> ws(model);
  Vector tau(static_cast<std::size_t>(model.nv));
  S.ground(model, ws, in);
  S.hinge_records(model, ws, in);
  for (const Run& run : model.runs) S.outward(model, ws, in, run, {.vdot = true});
  if (elastic) S.elastic(model, ws, in);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) soa::gather<Quad>(model, ws, in, *run, tau.data());
  return tau;
}

/// Where inertias follow the deformation, by the dense twin of what compile() kept of them: families compute in double alone.
std::vector<Exact> by_twin(const BenchModel& bm, const Model& model) {
  using T = reference::Quad;
  const auto down = [](const reference::VecX<T>& x) { return Eigen::VectorXd(x.cast<double>()); };
  const reference::DenseTwin<T> twin(reference::dense_model<T>(*model.spec));
  std::vector<Exact> results;
  for (const BenchState& state : bm.states) {
    if (results.size() == 3) break;
    const auto s = twin.at(state.q.cast<T>(), state.v.cast<T>());
    const reference::VecX<T> M_vdot = s.M * state.vdot.cast<T>();
    results.push_back({down(s.forward(state.tau.cast<T>())), down(s.inverse(state.vdot.cast<T>())), down(M_vdot), {}});
  }
  return results;
}

}  // namespace

std::vector<Exact> exact(const BenchModel& bm, const Registry& registry) {
  if (const auto model = compile(bm.spec, registry);
      !std::ranges::all_of(model->flexible, [](const FlexibleBody& f) { return f.constant; }))
    return by_twin(bm, *model);
  const CompileOptions options{.merge_locked = false, .choose_frames = false, .node_wrenches = false, .world_wrenches = false};
  // Where masses are graded, particles are to be particles: m, h, J rounded one by one are not. Refined from their mass centres.
  const bool graded = compile(bm.spec, registry)->has(OpCode::refine);
  const auto model = assemble(std::make_shared<const SystemSpec>(bm.spec), registry, options, graded);
  const Vector rest(static_cast<std::size_t>(model->nv), Quad(0));
  std::vector<Exact> results;
  for (const BenchState& state : bm.states) {
    if (results.size() == 3) break;
    const Vector q = up(state.q), v = up(state.v), tau = up(state.tau), vdot = up(state.vdot);
    soa::Inputs<Quad> in;
    in.q = q.data(), in.v = v.data(), in.tau = tau.data(), in.vdot = vdot.data();
    soa::Inputs<Quad> matrix = in;  // at rest, without gravity and the stiffness of modes, only the mass matrix is left
    matrix.v = rest.data(), matrix.gravity = false;
    results.push_back(
        {down(forward(*model, in)), down(inverse(*model, in)), down(inverse(*model, matrix, false)), down(forward(*model, matrix, false))});
  }
  return results;
}

double relative_error(const Eigen::VectorXd& computed, const Eigen::VectorXd& exact) {
  const double error = Eigen::VectorXd(computed - exact).stableNorm() / exact.stableNorm();
  return std::isfinite(error) ? error : std::numeric_limits<double>::infinity();
}

void write_exact(const std::filesystem::path& folder, const BenchModel& bm, const std::vector<Exact>& states) {
  const auto list = [](const Eigen::VectorXd& x) { return std::vector<double>(x.data(), x.data() + x.size()); };
  nlohmann::json j;
  for (const Exact& e : states)
    j.push_back({{"vdot", list(e.vdot)}, {"tau", list(e.tau)}, {"M_vdot", list(e.M_vdot)}, {"Minv_tau", list(e.Minv_tau)}});
  std::filesystem::create_directories(folder);
  std::ofstream(folder / (bm.name + ".json")) << j.dump() << "\n";
}

}  // namespace cardan::bench
