#include "core/model/coupling.hpp"

#include <algorithm>
#include <cmath>

namespace cardan {

const std::vector<std::string>& function_kinds() {
  static const std::vector<std::string> all = {"polynomial", "sine", "cosine", "table"};
  return all;
}

namespace {

SmoothFunction::Jet of_polynomial(const std::vector<double>& c, double x) {
  SmoothFunction::Jet j;
  for (std::size_t i = c.size(); i-- > 0;) {  // Horner's scheme, of the derivatives too
    j.third = j.third * x + 3.0 * j.curvature;
    j.curvature = j.curvature * x + 2.0 * j.slope;
    j.slope = j.slope * x + j.value;
    j.value = j.value * x + c[i];
  }
  return j;
}

SmoothFunction::Jet of_table(const std::vector<double>& numbers, double period, double x) {
  const auto n = static_cast<int>(numbers.size() / 3);
  const auto number = [&](int point, int which) { return numbers[static_cast<std::size_t>(3 * point + which)]; };
  if (period > 0.0) x -= period * std::floor((x - number(0, 0)) / period);
  int i = 0;  // of the stretch
  for (int step = n; step > 0; step /= 2)
    while (i + step < n - 1 && number(i + step, 0) <= x) i += step;
  const double h = number(i + 1, 0) - number(i, 0), b = (x - number(i, 0)) / h, a = 1.0 - b;
  const double F0 = number(i, 1), F1 = number(i + 1, 1), M0 = number(i, 2), M1 = number(i + 1, 2), rise = (F1 - F0) / h;
  if (b < 0.0) {
    const double slope = rise - h * (2.0 * M0 + M1) / 6.0;
    return {F0 + slope * b * h, slope, 0.0, 0.0};
  }
  if (a < 0.0) {
    const double slope = rise + h * (M0 + 2.0 * M1) / 6.0;
    return {F1 - slope * a * h, slope, 0.0, 0.0};
  }
  return {a * F0 + b * F1 + h * h / 6.0 * (a * (a * a - 1.0) * M0 + b * (b * b - 1.0) * M1),
          rise + h / 6.0 * ((1.0 - 3.0 * a * a) * M0 + (3.0 * b * b - 1.0) * M1), a * M0 + b * M1, (M1 - M0) / h};
}

}  // namespace

SmoothFunction::Jet SmoothFunction::at(double x) const {
  switch (kind) {
    case Kind::polynomial:
      return of_polynomial(numbers, x);
    case Kind::sine:
    case Kind::cosine: {
      const double s = numbers[0] * std::sin(x), c = numbers[0] * std::cos(x);
      return kind == Kind::sine ? Jet{s, c, -s, -c} : Jet{c, -s, -c, s};
    }
    case Kind::table:
      break;
  }
  return of_table(numbers, period, x);
}

// F'' at the points from continuous slopes (Cauchy 1821 has the cubic, de Boor 1978 the conditions): h0 M0 + 2 (h0 + h1) M1 + h1 M2 =
// 6 (rise1 - rise0), by elimination; where it repeats the last unknown stands apart.
SmoothFunction SmoothFunction::through(const std::vector<double>& x, const std::vector<double>& F, bool repeats) {
  const auto n = static_cast<int>(x.size()), unknown = repeats ? n - 1 : n - 2, first = repeats ? 0 : 1;
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  const auto h = [&](int i) { return i < 0 ? x[at(n - 1)] - x[at(n - 2)] : x[at(i + 1)] - x[at(i)]; };
  const auto rise = [&](int i) { return i < 0 ? (F[at(n - 1)] - F[at(n - 2)]) / h(-1) : (F[at(i + 1)] - F[at(i)]) / h(i); };
  std::vector<double> M(at(n), 0.0), diagonal(at(std::max(unknown, 0))), right(diagonal), last(diagonal);
  // Unknowns M_first .. in order, each hanging on the next and, where it repeats, on the last one of all.
  for (int i = 0; i < unknown; ++i) {
    const int k = first + i;
    diagonal[at(i)] = 2.0 * (h(k - 1) + h(k)), right[at(i)] = 6.0 * (rise(k) - rise(k - 1));
  }
  const int inner = repeats ? unknown - 1 : unknown;  // without the last one
  if (repeats) {
    last[0] += h(-1);
    last[at(inner - 1)] += h(first + inner - 1);
  }
  for (int i = 1; i < inner; ++i) {
    const double factor = h(first + i - 1) / diagonal[at(i - 1)];
    diagonal[at(i)] -= factor * h(first + i - 1), right[at(i)] -= factor * right[at(i - 1)], last[at(i)] -= factor * last[at(i - 1)];
  }
  for (int i = inner - 1; i >= 0; --i) {  // M_i = right - last M_last
    const double next = i + 1 < inner ? h(first + i) : 0.0;
    right[at(i)] = (right[at(i)] - next * (i + 1 < inner ? right[at(i + 1)] : 0.0)) / diagonal[at(i)];
    last[at(i)] = (last[at(i)] - next * (i + 1 < inner ? last[at(i + 1)] : 0.0)) / diagonal[at(i)];
  }
  double of_last = 0.0;
  if (repeats) {
    const int k = unknown - 1;
    of_last =
        (right[at(k)] - h(k - 1) * right[at(k - 1)] - h(k) * right[0]) / (diagonal[at(k)] - h(k - 1) * last[at(k - 1)] - h(k) * last[0]);
    M[at(k)] = of_last;
  }
  for (int i = 0; i < inner; ++i) M[at(first + i)] = right[at(i)] - last[at(i)] * of_last;
  if (repeats) M[at(n - 1)] = M[0];
  SmoothFunction out;
  out.kind = Kind::table;
  if (repeats) out.period = x.back() - x.front();
  for (int i = 0; i < n; ++i) out.numbers.insert(out.numbers.end(), {x[at(i)], F[at(i)], M[at(i)]});
  return out;
}

void Coupling::at(const double* q, const double* v, double* gradient, double& c, double& extra) const {
  c = -offset, extra = 0.0;
  for (std::size_t i = 0; i < terms.size(); ++i) c += terms[i].coefficient * q[terms[i].q], gradient[i] = terms[i].coefficient;
  for (const Function& f : functions) {
    double x = f.phase, rate = 0.0;
    for (const Function::Argument& u : f.of) {
      const CoupledRate& term = terms[static_cast<std::size_t>(u.term)];
      x += u.a * q[term.q], rate += u.a * v[term.v];
    }
    const SmoothFunction::Jet F = f.F.at(x);
    c += F.value, extra += F.curvature * rate * rate;
    for (const Function::Argument& u : f.of) gradient[static_cast<std::size_t>(u.term)] += F.slope * u.a;
  }
}

void Coupling::along(const double* q, const double* v, const double* dq, const double* dv, double* gradient, double& extra) const {
  std::fill_n(gradient, terms.size(), 0.0);
  extra = 0.0;
  for (const Function& f : functions) {
    double x = f.phase, rate = 0.0, dx = 0.0, drate = 0.0;
    for (const Function::Argument& u : f.of) {
      const auto i = static_cast<std::size_t>(u.term);
      x += u.a * q[terms[i].q], rate += u.a * v[terms[i].v], dx += u.a * dq[i], drate += u.a * dv[i];
    }
    const SmoothFunction::Jet F = f.F.at(x);
    extra += (F.third * dx * rate + 2.0 * F.curvature * drate) * rate;
    for (const Function::Argument& u : f.of) gradient[static_cast<std::size_t>(u.term)] += F.curvature * dx * u.a;
  }
}

}  // namespace cardan
