// Momenta and their rates against the sweeps of inverse dynamics and their exact derivatives.
#include "core/dynamics/momenta.hpp"

#include "core/operators/sensitivity.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

/// p = M v; rate = (dM along v) v - C(q, v): M by its columns, dM by sweeps that carry a derivative. Of the rates the largest terms cancel.
TEST(Momenta, AndTheirRatesAreThoseOfTheMassMatrix) {
  for (const TreeOptions& options : {TreeOptions{}, TreeOptions{.flexible = 0.0}, TreeOptions{.bodies = 4, .roots = 1, .flexible = 1.0},
                                     TreeOptions{.bodies = 5, .flexible = 0.6, .modes = 20, .plain_masses = true},
                                     TreeOptions{.bodies = 5, .flexible = 0.0, .hinges = {"universal", "gimbal", "planar"}}})
    for_all_trees(options, 1e-11, [](const RandomTree& tree) {
      Loaded s(tree);
      Momenta momenta(*s.model);
      VectorXd p(s.model->nv), rate(s.model->nv), dM_v(s.model->nv);
      momenta.at(s.ws, s.state.q.data(), s.state.v.data(), p.data(), rate.data());
      const VectorXd bias = bias_force(*s.model, s.ws, s.state.q.data(), s.state.v.data());
      operators::Sensitivities d(s.model, operators::Sensitivities::Springs::left_out);
      d.at(Inputs{.q = s.state.q.data(), .v = s.state.v.data()});
      d.mass(s.state.v.data(), s.state.v.data(), dM_v.data());
      const VectorXd Mv = mass_matrix(*s.model, s.ws, s.state.q.data()) * s.state.v;
      return worse(apart(p, Mv), apart(rate, VectorXd(dM_v - bias), largest(bias)));
    });
}

}  // namespace
}  // namespace cardan::test
