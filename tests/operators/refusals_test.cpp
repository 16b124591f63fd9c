// What the operators and what is made of them answer to sizes that do not fit, indices that there are not, and calls in the wrong order:
// an InputError with its code, never numbers from memory that is not theirs.
#include "core/operators/diagonalised.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/operational_space.hpp"
#include "core/operators/sensitivity.hpp"
#include "tests/operators/views.hpp"

namespace cardan::test {
namespace {

using namespace cardan::operators;

template <class Call>
std::string code_of(const Call& call) {
  try {
    call();
  } catch (const InputError& e) {
    return std::string(number_of(e.diagnostics().front().code));
  }
  return "none";
}

TEST(Refusals, OfWhatDoesNotFit) {
  const std::shared_ptr<const Model> model = compiled(system(base_with_sprung_arm()));
  const int n = model->nv;
  TreeOperators tree(model);
  tree.at(model->initial_state().q.data()), tree.articulate(), tree.operational_space();
  const VectorXd one = VectorXd::Ones(n), short_of = VectorXd::Ones(n - 1);

  TreeOperators masked(model);
  masked.at(model->initial_state().q.data());
  const std::vector<std::uint8_t> mask(static_cast<std::size_t>(n - 1), 1);
  EXPECT_EQ(code_of([&] { masked.articulate({.W = nullptr, .free = mask}); }), "C0902");

  Diagonalised diagonalised(tree);
  VectorXd v = short_of;
  EXPECT_EQ(code_of([&] { diagonalised.from_velocity(short_of); }), "C0902");
  EXPECT_EQ(code_of([&] { diagonalised.to_velocity(one, v); }), "C0902");
  v = one;
  EXPECT_EQ(code_of([&] { diagonalised.to_velocity(short_of, v); }), "C0902");
  EXPECT_EQ(code_of([&] { diagonalised.eps(short_of); }), "C0902");
  EXPECT_EQ(code_of([&] { diagonalised.coriolis(short_of); }), "C0902");

  const OperationalSpace space(tree, Task{{0}, {}});
  const VectorXd six = VectorXd::Ones(6), two = VectorXd::Ones(2);
  EXPECT_EQ(code_of([&] { space.force_for(two, two); }), "C0902");
  EXPECT_EQ(code_of([&] { space.force_for(six, two); }), "C0902");

  EXPECT_EQ(code_of([&] { tree.subtree(99); }), "C0201");
  EXPECT_EQ(code_of([&] { tree.path(0, -1); }), "C0201");
}

TEST(Refusals, OfWhatIsNotThereYet) {
  const std::shared_ptr<const Model> model = compiled(system(base_with_sprung_arm()));
  Sensitivities s(model);
  EXPECT_EQ(code_of([&] { s.forward(); }), "C0901");
  EXPECT_EQ(code_of([&] { s.inverse(); }), "C0901");
  EXPECT_EQ(code_of([&] { s.forward_in_inertia(0); }), "C0901");
  EXPECT_EQ(code_of([&] { s.solve({}); }), "C0902");
  EXPECT_EQ(code_of([&] { s.at({}); }), "C0902");
  EXPECT_EQ(code_of([&] { linearize(*model, {}); }), "C0902");
  EXPECT_EQ(code_of([] { TreeOperators none(nullptr); }), "C0209");
  EXPECT_EQ(code_of([&] { TreeOperators(model).at(nullptr); }), "C0902");
}

}  // namespace
}  // namespace cardan::test
