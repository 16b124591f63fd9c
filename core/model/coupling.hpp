#pragma once
// Couplings of coordinates (docs/mathematics/loops.md, 1): sum of coefficient q + sum of F(phase + sum of a q) = offset.
#include <cstdint>
#include <string>
#include <vector>

namespace cardan {

/// A function of one number that is smooth twice.
struct SmoothFunction {
  enum class Kind : std::uint8_t { polynomial, sine, cosine, table };
  Kind kind = Kind::polynomial;
  /// Of a polynomial its coefficients, ascending; of a sine or cosine its amplitude; of a table x, F and F'' of each point, x rising.
  std::vector<double> numbers;
  double period = 0.0;  // of a table that repeats; 0: beyond its ends it goes on straight

  struct Jet {
    double value = 0.0, slope = 0.0, curvature = 0.0, third = 0.0;
  };
  Jet at(double x) const;

  /// Cubic between the points, F'' continuous: zero at the ends, or as at the other end where it repeats (then the last F is the first).
  /// x rises; at least two points, three where it repeats.
  static SmoothFunction through(const std::vector<double>& x, const std::vector<double>& F, bool repeats);
};

/// Words of SmoothFunction::Kind, in its order.
const std::vector<std::string>& function_kinds();

/// A coordinate that a coupling has, and its rate.
struct CoupledRate {
  int q, v;
  double coefficient;
};

struct Coupling {
  /// F(phase + sum of a q).
  struct Function {
    struct Argument {
      int term;  // index into Coupling::terms
      double a;
    };
    SmoothFunction F;
    double phase = 0.0;
    std::vector<Argument> of;
  };
  std::vector<CoupledRate> terms;  // each coordinate once; the coefficient is of the linear part
  double offset = 0.0;
  std::vector<Function> functions;

  bool is_linear() const { return functions.empty(); }
  /// Of a coupling that is not linear: `gradient` per term; c; and what c'' has without v'.
  void at(const double* q, const double* v, double* gradient, double& c, double& extra) const;
  /// ... how the gradient, and c'' at fixed v', change where q moves by dq and v by dv (both per term).
  void along(const double* q, const double* v, const double* dq, const double* dv, double* gradient, double& extra) const;
};

/// A row that is given as a function of time, at one instant: by how much its length or offset is more than the model has.
struct LoopDrive {
  double more = 0.0, rate = 0.0, acceleration = 0.0;
};

}  // namespace cardan
