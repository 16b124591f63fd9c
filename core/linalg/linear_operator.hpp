#pragma once
// A linear map that is known only by what it does to a vector. Views: they own nothing and cost one indirect call.
#include <Eigen/Core>
#include <stdexcept>
#include <string>

namespace cardan {

/// y = A x, as a view of any callable `void(const VectorXd& x, VectorXd& y)` that outlives it. y arrives with the right
/// size.
class MultiplyRef {
 public:
  MultiplyRef() = default;
  template <class F>
  MultiplyRef(const F& f)  // NOLINT: a view converts
      : object_(&f), call_([](const void* o, const Eigen::VectorXd& x, Eigen::VectorXd& y) { (*static_cast<const F*>(o))(x, y); }) {}
  void operator()(const Eigen::VectorXd& x, Eigen::VectorXd& y) const { call_(object_, x, y); }

 private:
  const void* object_ = nullptr;
  void (*call_)(const void*, const Eigen::VectorXd&, Eigen::VectorXd&) = nullptr;
};

struct LinearOperator {
  int rows = 0, cols = 0;
  MultiplyRef mult;            // y = A x
  MultiplyRef mult_transpose;  // y = A* x
};

/// A factorisation or an eigen-solution that did not succeed; what() says what was met.
struct LinalgError : std::runtime_error {
  explicit LinalgError(const std::string& what, int singular_row = -1) : std::runtime_error(what), row(singular_row) {}
  int row;  // of the zero pivot, or -1
};

}  // namespace cardan
