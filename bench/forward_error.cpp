#include "bench/forward_error.hpp"

#include <boost/multiprecision/float128.hpp>

#include "core/soa/sweeps_impl.hpp"

namespace cardan::bench {

using Quad = boost::multiprecision::float128;

double forward_error(const Model& model, const BenchState& state, const Eigen::VectorXd& vdot) {
  using S = soa::Sweeps<Quad>;
  soa::Workspace<Quad> ws(model);
  const auto up = [](const Eigen::VectorXd& x) { return std::vector<Quad>(x.data(), x.data() + x.size()); };
  const std::vector<Quad> q = up(state.q), v = up(state.v), tau = up(state.tau);
  std::vector<Quad> exact(static_cast<std::size_t>(model.nv));
  soa::Inputs<Quad> in;
  in.q = q.data(), in.v = v.data(), in.tau = tau.data();
  S::ground(model, ws, in);
  S::hinge_records(model, ws, in);
  for (const Run& run : model.runs) S::outward(model, ws, in, run, false, true);
  if (model.has(Kernel::elastic)) S::elastic(model, ws, in);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S::inward(model, ws, in, *run, {});
  for (const Run& run : model.runs) S::acceleration(model, ws, in, run, exact.data());
  Quad difference = 0, size = 0;
  for (int i = 0; i < model.nv; ++i) {
    const Quad e = exact[static_cast<std::size_t>(i)], d = Quad(vdot[i]) - e;
    difference += d * d;
    size += e * e;
  }
  return static_cast<double>(sqrt(difference / size));
}

}  // namespace cardan::bench
