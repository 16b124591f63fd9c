// Explicit Runge-Kutta methods with few operations around the right-hand side: the stage sums are fused and unrolled at
// compile time, and a step allocates nothing.
#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"
#include "core/time/node_quadrature.hpp"

namespace cardan {
namespace {

// A tableau: stage s is evaluated at t + c[s] h, x + h sum_j a[s][j] k_j. Row rows - 1 is the result of the step, and
// its slope is the first stage of the next step. Stages behind it serve the dense output alone, where it is asked for.

/// The classic method of Kutta (1901).
struct Rk4 {
  static constexpr std::string_view name = "rk4";
  static constexpr int order = 4, rows = 5, stages = rows;
  static constexpr bool adaptive = false, integrals_by_nodes = true;
  static constexpr double c[] = {0.0, 1.0 / 2, 1.0 / 2, 1.0, 1.0};
  static constexpr double a[stages][stages] = {{}, {1.0 / 2}, {0.0, 1.0 / 2}, {0.0, 0.0, 1.0}, {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6}};
};

/// Dormand, Prince 1980: order 5 with an estimate of order 4; dense output of order 4 by Shampine 1986.
struct Dopri5 {
  static constexpr std::string_view name = "dopri5";
  static constexpr int order = 5, rows = 7, stages = rows;
  static constexpr bool adaptive = true, integrals_by_nodes = true;
  static constexpr double stability = 3.25;  // on the negative real axis
  static constexpr double c[] = {0.0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1.0, 1.0};
  static constexpr double a[stages][stages] = {{},
                                               {1.0 / 5},
                                               {3.0 / 40, 9.0 / 40},
                                               {44.0 / 45, -56.0 / 15, 32.0 / 9},
                                               {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
                                               {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
                                               {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static constexpr double error[1][rows] = {{71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40}};
  /// Third divided difference of rates that are given at the stages, over a step of 1.
  static constexpr double third[] = {-25.0 / 6, 0.0, 200.0 / 21, -25.0 / 2, 0.0, 0.0, 50.0 / 7};
  static constexpr double dense[1][stages] = {{-12715105075.0 / 11282082432, 0.0, 87487479700.0 / 32700410799, -10690763975.0 / 1880347072,
                                               701980252875.0 / 199316789632, -1453857185.0 / 822651844, 69997945.0 / 29380423}};
};

/// Dormand, Prince 1980 and 1989 (8(5,3), the coefficients of Hairer, Norsett, Wanner 1993, II.5, 20 digits): order 8, estimates of order 5
/// and 3; dense output of order 7 with three more stages. Between the ends of its long steps rates are not smooth enough for integrals by
/// nodes.
struct Dop853 {
  static constexpr std::string_view name = "dop853";
  static constexpr int order = 8, rows = 13, stages = 16;
  static constexpr bool adaptive = true, integrals_by_nodes = false;
  static constexpr double stability = 6.1;
  static constexpr double c[] = {0.0,
                                 0.052600151958767731879,
                                 0.078900227938151597818,
                                 0.11835034190722739673,
                                 0.28164965809277260327,
                                 1.0 / 3,
                                 0.25,
                                 4.0 / 13,
                                 127.0 / 195,
                                 0.6,
                                 6.0 / 7,
                                 1.0,
                                 1.0,
                                 0.1,
                                 0.2,
                                 7.0 / 9};
  static constexpr double a[stages][stages] = {
      {},
      {0.052600151958767731879},
      {0.019725056984537899454, 0.059175170953613698363},
      {0.029587585476806849182, 0.0, 0.088762756430420547545},
      {0.24136513415926668550, 0.0, -0.88454947932828608534, 0.92483400326179200312},
      {0.037037037037037037037, 0.0, 0.0, 0.17082860872947387128, 0.12546768756682242502},
      {0.037109375, 0.0, 0.0, 0.17025221101954403931, 0.060216538980455960685, -0.017578125},
      {0.037092000118504792711, 0.0, 0.0, 0.17038392571223999381, 0.10726203044637328465, -0.015319437748624401753,
       0.0082737891638140228876},
      {0.62411095871607571711, 0.0, 0.0, -3.3608926294469412941, -0.86821934684172600682, 27.592099699446708305, 20.154067550477893409,
       -43.489884181069958848},
      {0.47766253643826436589, 0.0, 0.0, -2.4881146199716676419, -0.59029082683684299637, 21.230051448181194235, 15.279233632882423583,
       -33.288210968984862919, -0.020331201708508626136},
      {-0.93714243008598732572, 0.0, 0.0, 5.1863724288440637083, 1.0914373489967295782, -8.1497870107469261251, -18.520065659996959864,
       22.739487099350504282, 2.4936055526796523899, -3.0467644718982195004},
      {2.2733101475165382079, 0.0, 0.0, -10.534495466737250198, -2.0008720582248624991, -17.958931863118798917, 27.948884529419960051,
       -2.8589982771350236947, -8.8728569335306295443, 12.360567175794303065, 0.64339274601576353036},
      {0.054293734116568762238, 0.0, 0.0, 0.0, 0.0, 4.4503128927524088814, 1.8915178993145003830, -5.8012039600105847815,
       0.31116436695781989441, -0.15216094966251607856, 0.20136540080403034837, 0.044710615727772590518},
      {0.056167502283047952339, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25350021021662481109, -0.24623903747080248992, -0.12419142326381636047,
       0.15329179827876569731, 0.0082010522956346898849, 0.0075678976605456997614, -0.008298},
      {0.031834648163502140506, 0.0, 0.0, 0.0, 0.0, 0.028300909672366775529, 0.053541988307438567622, -0.054923748571390988465, 0.0, 0.0,
       -0.00010834732869724932286, 0.00038257109083565841295, -0.00034046500868740456080, 0.14131244367463250028},
      {-0.42889630158379192341, 0.0, 0.0, 0.0, 0.0, -4.6976214153611638431, 7.6834211960625990418, 4.0689898183971100797,
       0.35672718745528110927, 0.0, 0.0, 0.0, -0.0013990241651590146213, 2.9475147891527723390, -9.1509584721798700108}};
  static constexpr double error[2][rows] = {
      {0.013120044994194880733, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044407, -0.49575894965725019152, 1.6643771824549865370,
       -0.35032884874997368169, 0.33417911871301747903, 0.081923206485115712466, -0.022355307863886295259},
      {-0.18980075407240761571, 0.0, 0.0, 0.0, 0.0, 4.4503128927524088814, 1.8915178993145003830, -5.8012039600105847815,
       -0.42268232132379196293, -0.15216094966251607856, 0.20136540080403034837, 0.022651792198360825812}};
  static constexpr double dense[4][stages] = {
      {-8.4289382761090128651, 0.0, 0.0, 0.0, 0.0, 0.56671495351937776963, -3.0689499459498916913, 2.3846676565120698288,
       2.1170345824450282767, -0.87139158377797299207, 2.2404374302607882759, 0.63157877876946881816, -0.088990336451333310821,
       18.148505520854727257, -9.1946323924783554000, -4.4360363875948939664},
      {10.427508642579134603, 0.0, 0.0, 0.0, 0.0, 242.28349177525818288, 165.20045171727028199, -374.54675472269020280,
       -22.113666853125306036, 7.7334326684722638390, -30.674084731089398182, -9.3321305264302278730, 15.697238121770843886,
       -31.139403219565177677, -9.3529243588444783866, 35.816841486394083752},
      {19.985053242002433821, 0.0, 0.0, 0.0, 0.0, -387.03730874935176555, -189.17813819516756883, 527.80815920542364901,
       -11.573902539959630126, 6.8812326946963000170, -1.0006050966910838403, 0.77771377980534432093, -2.7782057523535084066,
       -60.196695231264120758, 84.320405506677161018, 11.992291136182789328},
      {-25.693933462703749003, 0.0, 0.0, 0.0, 0.0, -154.18974869023643374, -231.52937917604549568, 357.63911791061412378,
       93.405324183624310004, -37.458323136451633157, 104.09964950896230045, 29.840293426660503123, -43.533456590011143754,
       96.324553959188282948, -39.177261675615439165, -149.72683625798562581}};
};

/// The weights of the slopes: rows of the tableau, then those of the error estimate and of the dense output.
template <class Method, int Row>
constexpr double weight(int j) {
  if constexpr (Row < Method::stages) {
    return Method::a[Row][j];
  } else {
    constexpr int estimate = Row - Method::stages, estimates = static_cast<int>(std::size(Method::error));
    if constexpr (estimate < estimates)
      return Method::error[estimate][j];
    else
      return Method::dense[estimate - estimates][j];
  }
}
/// How many slopes a row sums up.
template <class Method>
constexpr int slopes_of(int row) {
  if constexpr (Method::adaptive)
    if (row >= Method::stages && row < Method::stages + static_cast<int>(std::size(Method::error))) return Method::rows;
  return std::min(row, Method::stages);
}

/// out[i] = z[i] + h sum_j weight_j k_j[i] over slopes that stand one after the other at k, `stride` apart: one loop, its sum
/// unrolled from the last slope to the first, nothing for a weight of zero.
template <class Method, int Row, int... Slopes>
void combine(std::integer_sequence<int, Slopes...>, const double* __restrict z, double h, const double* __restrict k, std::size_t stride,
             std::size_t size, double* __restrict out) {
  constexpr auto w = [](int j) { return weight<Method, Row>(j); };
  constexpr int last = static_cast<int>(sizeof...(Slopes)) - 1;
  for (std::size_t i = 0; i < size; ++i) {
    double sum = 0.0;
    ((w(last - Slopes) != 0.0 ? void(sum += w(last - Slopes) * k[i + (last - Slopes) * stride]) : void()), ...);
    out[i] = z[i] + h * sum;
  }
}

template <class Method>
class RungeKutta final : public Integrator {
 public:
  RungeKutta(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)),
        options_(options),
        events_(problem_),
        nodes_(problem_.n_quadrature),
        n_(problem_.n),
        n_all_(problem_.n + problem_.n_quadrature),
        z0_(Eigen::ArrayXd::Zero(n_all_)),
        z1_(Eigen::ArrayXd::Zero(n_all_)),
        work_(n_all_),
        inner_(n_all_),
        zero_(Eigen::ArrayXd::Zero(n_all_)),
        share_(n_),
        staged_error_(Eigen::ArrayXd::Zero(problem_.n_quadrature)),
        all_error_(Eigen::ArrayXd::Zero(problem_.n_quadrature)),
        k_(Eigen::ArrayXXd::Zero(n_all_, Method::stages)),
        absolute_(Eigen::Map<const Eigen::ArrayXd>(problem_.absolute_tolerance.data(), n_)) {
    const std::vector<double> weights = group_weights(problem_.group);
    weight_ = Eigen::Map<const Eigen::ArrayXd>(weights.data(), static_cast<Eigen::Index>(weights.size()));
  }

  void restart(double t, const double* x) override {
    if (!started_ || t != t1_) h_ = options_.initial_step;  // else the last step size is a good first guess
    started_ = true;
    slope_known_ = false;
    tries_ = kTries;
    if (problem_.n_quadrature > 0) {
      integrals(t1_, z1_.data() + n_, all_error_.data());
      nodes_.begin_stretch_at(z1_.data() + n_, all_error_.data());
      staged_error_.setZero();
    }
    staged_ = true;
    t0_ = t1_ = t;
    std::copy_n(x, n_, z1_.data());
    if (problem_.n_roots > 0) events_.restart(t, z1_.data());
    ++statistics_.restarts;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    if (t1_ < t_stop) {
      begin();
      ++statistics_.steps;
      if constexpr (Method::adaptive) {
        doubts_ = kTries;
        do report.limit = adaptive_step(t_stop);
        while (problem_.n_roots > 0 && !find_event(report));
        statistics_.error_sum += error_;
        tries_ = 0;
        report.stiff = stiff();
        look_at_rounding(report);
      } else {
        fixed_step(t_stop);
        if (problem_.n_quadrature > 0 && statistics_.steps % kSampled == 1) sample_error();
        if (problem_.n_roots > 0) find_event(report);
      }
      if (problem_.n_quadrature > 0) {
        if (staged_) add_staged_error();
        add_node();
      }
      if (report.event) report.limit = StepLimit::stop;
      statistics_.last_step = t1_ - t0_;
    }
    report.t = t1_;
    report.order = Method::order;
    std::copy_n(z1_.data(), n_, x);
    return report;
  }

  void interpolate(double t, double* x) override {
    dense_output(t);
    if (t != t1_ && problem_.project) problem_.project(t, work_.data());
    std::copy_n(work_.data(), n_, x);
  }

  void integrals(double t, double* y, double* error) override {
    if (!staged_) return nodes_.at(t, y, error);
    dense_output(t);
    std::copy_n(work_.data() + n_, problem_.n_quadrature, y);
    for (int i = 0; error && i < problem_.n_quadrature; ++i) error[i] = all_error_[i] + staged_error_[i];
  }

  void remember(Archive& archive) override {
    const auto n = static_cast<std::size_t>(problem_.n_quadrature);
    archive(h_, at_the_limit_, inside_, statistics_, std::span(z1_.data() + n_, n), std::span(all_error_.data(), n), events_);
    if (archive.reading()) nodes_.begin_stretch_at(z1_.data() + n_, all_error_.data());
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s = statistics_;
    s.root_evaluations = events_.evaluations();
    s.last_order = Method::order;
    return s;
  }

  int worst() const override { return worst_; }

  std::string_view name() const override { return Method::name; }

 private:
  static constexpr int kTries = 8;           // of the first step after a start, and of one whose inside is in doubt
  static constexpr int kSampled = 8;         // steps of rk4 to each that is estimated, the first of them
  static constexpr int kStiffness = 1000;    // steps to each whose stability is looked at
  static constexpr double kDoubtful = 10.0;  // error, over what is allowed, of a step to the inside of an accurate one
  static constexpr int kLast = Method::rows - 1, kError = Method::stages;

  auto first_slope() const { return k_.col(0); }
  auto last_slope() const { return k_.col(kLast); }

  bool finite(const auto& values) const { return all_finite(values.data(), n_); }

  /// inner_ = the part of the dense output at s beyond the cubic Hermite polynomial, as Hairer, Norsett, Wanner 1993, II.6 nest it.
  void inner_output(double h, double s) {
    if constexpr (!Method::adaptive) return void(inner_.setZero());
    if constexpr (Method::adaptive) {
      constexpr int n = static_cast<int>(std::size(Method::dense)), first = kError + static_cast<int>(std::size(Method::error));
      inner_.setZero();
      [&]<int... I>(std::integer_sequence<int, I...>) {  // from the innermost to the outermost
        ((add_slopes<first + n - 1 - I>(zero_, h, n_all_, work_), inner_ = work_ + ((n - 1 - I) % 2 == 0 ? s : 1.0 - s) * inner_), ...);
      }
      (std::make_integer_sequence<int, n>{});
    }
  }

  /// Whether a stage of these felt what no stage did that the end of the step is made of, as a contact that the step goes through: such a
  /// stage throws those behind it elsewhere, and by the conditions of its order neither the end of the step nor its error has anything of
  /// it.
  bool felt_alone(int first, int last) const {
    constexpr double kAlone = 10.0;  // times as far from the first slope
    const double h = t1_ - t0_;
    for (int i = 0; i < n_; ++i) {
      double alone = 0.0, together = 0.0;
      for (int j = first; j <= last; ++j)
        if (!is_in_the_end(j)) alone = std::max(alone, std::abs(k_(i, j) - k_(i, 0)));
      if (!(h * alone > absolute_[i] + options_.relative_tolerance * std::abs(z0_[i]))) continue;
      for (int j = 1; j < Method::rows; ++j)
        if (is_in_the_end(j)) together = std::max(together, std::abs(k_(i, j) - k_(i, 0)));
      if (alone > kAlone * together) return true;
    }
    return false;
  }
  static constexpr bool is_in_the_end(int stage) { return stage == kLast || (stage < kLast && Method::a[kLast][stage] != 0.0); }

  /// The stages that only the dense output needs.
  void complete_stages() {
    if (complete_) return;
    complete_ = [&]<int... I>(std::integer_sequence<int, I...>) {
      return ((add_slopes<Method::rows + I>(z0_, t1_ - t0_, n_, work_),
               rhs(t0_ + Method::c[Method::rows + I] * (t1_ - t0_), work_, Method::rows + I)) &&
              ...);
    }
    (std::make_integer_sequence<int, Method::stages - Method::rows>{});
    if (!complete_)
      fail_integration(Code::integrator_failed, t0_, "the right-hand side cannot be evaluated inside of a step", "a smaller step");
    if (problem_.n_roots > 0) doubtful_ = doubtful_ || felt_alone(Method::rows, Method::stages - 1);
  }

  /// work_ = states and integrals at t: of order 4 for dopri5, of 7 for dop853, the cubic Hermite polynomial for rk4.
  void dense_output(double t) {
    const double h = t1_ - t0_;
    if (t == t1_ || h == 0.0) return void(work_ = z1_);
    const double s = (t - t0_) / h;
    complete_stages();
    inner_output(h, s);
    within(s);
  }
  /// work_ = what lies between the ends of the step at its share s, by inner_.
  void within(double s) {
    const double h = t1_ - t0_, r = 1.0 - s;
    work_ = z0_ + s * (z1_ - z0_ +
                       r * (h * first_slope() - (z1_ - z0_) + s * (2.0 * (z1_ - z0_) - h * (first_slope() + last_slope()) + r * inner_)));
  }
  void cubic(double s) {
    inner_.setZero();
    within(s);
  }

  /// While a stretch is short, integrals are those of the tableau. From kPoints nodes on they go through the rates at the ends of the
  /// steps, of all of it: one evaluation a step in place of four or five.
  void add_node() {
    if (problem_.rough_integrands || !Method::integrals_by_nodes) return;
    nodes_.add(t1_, k_.col(kLast).data() + n_);
    if (nodes_.nodes() + 1 >= NodeQuadrature::kPoints) staged_ = false;
  }

  /// What the integrals of the stages may be off by: the estimate of a lower order, and how much that is below the trapezium's tells what a
  /// higher order gains. rk4 has no such pair for rates of time alone: there Simpson's rule, of which it is one, beside the trapezium.
  void add_staged_error() {
    const double h = t1_ - t0_;
    if constexpr (Method::adaptive) {
      add_slopes<kError>(zero_, h, n_all_, work_);
      inner_ = work_;
      if constexpr (std::size(Method::error) > 1) add_slopes<kError + 1>(zero_, h, n_all_, work_);
    }
    for (int i = n_; i < n_all_; ++i) {
      const double trapezium = 0.5 * h * std::abs(k_(i, kLast) - k_(i, 0)), lower = std::abs(inner_[i]);
      double& sum = staged_error_[i - n_];
      if constexpr (Method::order == 4) {
        const double simpson = h / 6.0 * std::abs(k_(i, 0) - k_(i, 1) - k_(i, 2) + k_(i, kLast));
        const double gain = simpson < trapezium ? simpson / trapezium : 1.0;
        sum += simpson * gain * gain + h / 6.0 * std::abs(k_(i, kLast - 1) - k_(i, kLast));
      } else if constexpr (Method::order == 5) {
        sum += lower * (lower < trapezium ? std::cbrt(lower / trapezium) : 1.0);
        // The rule is off by h^6 / 648000 of the fifth derivative. Where the fourth is zero the pair sees nothing of that; the square of
        // the third over the first does.
        double third = 0.0;
        for (int j = 0; j < Method::rows; ++j)
          if (Method::third[j] != 0.0) third += h * Method::third[j] * k_(i, j);
        third = std::abs(third);
        sum += third / 18000.0 * (third < 2.0 * trapezium ? third / (2.0 * trapezium) : 1.0);
      } else if (lower > 0.0) {
        sum += lower * lower / std::hypot(lower, 0.1 * work_[i]);
      }
    }
  }

  /// The integrals have no use for a slope without weight.
  static bool has_weight(int stage) { return stage >= kLast || Method::a[kLast][stage] != 0.0; }

  bool rhs(double t, const Eigen::ArrayXd& z, int stage) {
    ++statistics_.rhs_calls;
    double* slope = k_.col(stage).data();
    if (!problem_.rhs(t, z.data(), slope)) return false;
    if (problem_.n_quadrature > 0 && (stage == kLast || (staged_ && has_weight(stage)))) {
      ++statistics_.integrand_calls;
      problem_.integrands(t, z.data(), slope + n_);
    }
    return true;
  }

  /// out = z + h sum_j weight_j k_j, for the states alone or with the integrals.
  template <int Row>
  void add_slopes(const Eigen::ArrayXd& z, double h, int size, Eigen::ArrayXd& out) const {
    combine<Method, Row>(std::make_integer_sequence<int, slopes_of<Method>(Row)>{}, z.data(), h, k_.data(),
                         static_cast<std::size_t>(n_all_), static_cast<std::size_t>(size), out.data());
  }

  template <int Row>
  bool stage(double t1, double h) {
    const double t = Method::c[Row] == 1.0 ? t1 : t0_ + Method::c[Row] * h;
    if constexpr (Row < kLast) {
      add_slopes<Row>(z0_, h, n_, work_);
      return rhs(t, work_, Row);
    } else {
      add_slopes<Row>(z0_, h, n_all_, z1_);
      if (problem_.project) problem_.project(t, z1_.data());
      return rhs(t, z1_, Row);
    }
  }

  /// From (t0, z0) to t1; false: a stage could not be evaluated.
  bool try_step(double t1) {
    t1_ = t1;
    complete_ = Method::stages == Method::rows;
    return [&]<int... Row>(std::integer_sequence<int, Row...>) { return (stage<Row + 1>(t1, t1 - t0_) && ...); }
    (std::make_integer_sequence<int, kLast>{});
  }

  void must_step(double t1) {
    const double t0 = t0_;
    if (!try_step(t1) || !finite(z1_) || !finite(last_slope()))
      fail_integration(Code::integrator_failed, t0, fmt::format("{} in the step to t = {:.17g} s", trouble(), t1),
                       "a smaller step, or limits on what drives the state there");
  }

  std::string trouble() const {
    for (int s = 0; s < Method::rows; ++s)
      if (const int i = first_not_finite(k_.col(s).data(), n_); i >= 0) return fmt::format("the rate of state {} is {}", i, k_(i, s));
    if (!finite(z1_)) return "the state overflows";
    return "the right-hand side cannot be evaluated";
  }

  void begin() {
    if (!slope_known_ && (!rhs(t1_, z1_, kLast) || !finite(last_slope())))
      fail_integration(Code::integrator_failed, t1_,
                       finite(last_slope()) ? "the right-hand side cannot be evaluated at the start" : trouble(), {});
    if (problem_.n_quadrature > 0 && nodes_.nodes() == 0) nodes_.add(t1_, k_.col(kLast).data() + n_);
    slope_known_ = true;
    t0_ = t1_;
    z0_.swap(z1_);
    k_.col(0) = k_.col(kLast);
  }

  /// Equal steps up to t_stop: the number of steps left is rounded up, so that no sliver remains.
  void fixed_step(double t_stop) {
    constexpr double round_off = 1e-6;  // of a step; (t_stop - t0) / h is exact to about 1e-8 after a year at 0.1 s
    const double left = std::ceil((t_stop - t0_) / options_.fixed_step - round_off);
    must_step(left <= 1.0 ? t_stop : t0_ + (t_stop - t0_) / left);
  }

  /// Of the length of a step, so that its error is what is allowed.
  static double change_by(double error) { return 0.9 * std::pow(error, -1.0 / Method::order); }

  StepLimit adaptive_step(double t_stop) requires(Method::adaptive) {
    constexpr int max_rejections = 40;
    const double h_before = h_ > 0.0 ? h_ : first_guess();
    h_ = h_before;
    bool shortened = false;
    worst_ = -1;
    for (int rejections = 0;; ++rejections) {
      if (options_.max_step > 0.0) h_ = std::min(h_, options_.max_step);
      const double left = t_stop - t0_;
      const double t1 = h_ >= left ? t_stop : 2.0 * h_ > left ? t0_ + 0.5 * left : t0_ + h_;
      const double h = t1 - t0_;
      shortened = h < h_;
      const bool evaluated = try_step(t1);
      const double error = evaluated ? error_norm(h) : std::numeric_limits<double>::infinity();
      const double factor = std::clamp(change_by(error), 0.2, 5.0);
      const bool alone = error <= 1.0 && problem_.n_roots > 0 && rejections < kTries && felt_alone(1, kLast);
      if (error <= 1.0 && !alone) {
        const bool cut = 2.0 * h_ > left && h_ != left, longest = h_ == options_.max_step;
        const double next = h * (rejections > 0 ? std::min(factor, 1.0) : factor);
        h_ = shortened ? std::max(next, h_) : next;
        error_ = error;
        if (rejections > 0) return worst_ >= 0 ? StepLimit::error : StepLimit::given;
        if (cut || longest) return cut ? StepLimit::stop : StepLimit::given;
        worst_ = largest_of(share_.data(), n_);
        return worst_ >= 0 ? StepLimit::error : StepLimit::given;
      }
      worst_ = evaluated ? largest_of(share_.data(), n_) : -1;
      count_rejection(statistics_.rejected, problem_, worst_);
      h_ = h * (error > 1.0 && factor < 1.0 ? factor : 0.2);  // 0.2 also when the error is not a number, or of a stage alone
      if (rejections == max_rejections || h_ < 16.0 * std::numeric_limits<double>::epsilon() * std::abs(t0_))
        fail_integration(
            Code::step_too_small, t0_,
            fmt::format("step = {:.3g} s after {} rejections: {}", h_, rejections + 1,
                        std::isfinite(error) ? fmt::format("the error is {:.3g} times what the tolerances allow", error) : trouble()),
            "a discontinuity that is no event, a singularity, or a stiff system (cvode_bdf)");
    }
  }

  /// Root mean square over the states, or over their groups, of value / (absolute + relative * size).
  double norm(const auto& value) {
    share_ = value / (absolute_ + options_.relative_tolerance * z0_.head(n_).abs().max(z1_.head(n_).abs()));
    if (weight_.size() != 0) share_ *= weight_;
    return std::sqrt(share_.square().mean());
  }

  double error_norm(double h) {
    if (n_ == 0) return 0.0;
    add_slopes<kError>(zero_, 1.0, n_, work_);
    const double error = norm(work_.head(n_));
    if constexpr (std::size(Method::error) == 1) return h * error;
    // Two estimates in one, of order 8 and never large where the lower one is small; Hairer, Norsett, Wanner 1993, II.10.
    if (error == 0.0) return 0.0;
    add_slopes<kError + 1>(zero_, 1.0, n_, work_);
    if (!problem_.looked_inside) return h * error * error / std::hypot(error, 0.1 * norm(work_.head(n_)));
    // Inside of a step a swing is off by three times that, and each component by its own: the lower estimate of slow ones hides fast ones.
    constexpr double kInside = 3.0;
    inner_.head(n_) = share_.square();
    const double end = error * error / std::hypot(error, 0.1 * norm(work_.head(n_)));
    share_ = (inner_.head(n_) > 0.0).select(inner_.head(n_) / (inner_.head(n_) + 0.01 * share_.square()).sqrt(), 0.0);
    return h * std::max(end, kInside * std::sqrt(share_.square().mean()));
  }

  /// The fourth and the fifth slope of rk4 share time and weight conditions: changing one for the other gives a result of order 3,
  /// and the difference an estimate of some steps for all.
  void sample_error() {
    if (n_ == 0) return;
    const double error = (t1_ - t0_) / 6.0 * norm(k_.col(kLast - 1).head(n_) - last_slope().head(n_));
    statistics_.error_sum += kSampled * error;
  }

  /// Whether fifteen steps, none of them interrupted by six that are not, went to the end of the stability region on the
  /// negative real axis: h times the largest eigenvalue, as the last two slopes show it. Looked at once in kStiffness steps
  /// and while it lasts. Hairer, Wanner 1996, Solving Ordinary Differential Equations II, IV.2.
  bool stiff() requires(Method::adaptive) {
    if ((statistics_.steps % kStiffness != 0 && at_the_limit_ == 0) || n_ == 0) return false;
    add_slopes<kLast - 1>(z0_, t1_ - t0_, n_, work_);  // where the slope before the last was taken, at t1 too
    const double apart = norm(z1_.head(n_) - work_.head(n_));
    const double rate = norm(last_slope().head(n_) - k_.col(kLast - 1).head(n_));
    if ((t1_ - t0_) * rate > Method::stability * apart) {
      inside_ = 0;
      return ++at_the_limit_ % 15 == 0;
    }
    if (++inside_ == 6) at_the_limit_ = inside_ = 0;
    return false;
  }

  /// Looked at once in kStiffness steps.
  void look_at_rounding(StepReport& report) requires(Method::adaptive) {
    if (statistics_.steps % kStiffness != 0 || n_ == 0 || report.event) return;
    for (int i = 0; i < n_; ++i) work_[i] = moved_by_digits(z1_[i], i);
    if (!problem_.rhs(t1_, work_.data(), inner_.data())) return;
    const auto lost = [&](int estimate) {
      double squares = 0.0;
      for (const double e : Method::error[estimate]) squares += e * e;
      return kLostOfMoved * std::sqrt(squares);
    };
    double rounding = lost(0) * norm(inner_.head(n_) - last_slope().head(n_));
    report.rounded = largest_of(share_.data(), n_);
    if constexpr (std::size(Method::error) > 1) {  // as error_norm() has the two
      add_slopes<kError + 1>(zero_, 1.0, n_, work_);
      rounding *= rounding / std::hypot(rounding, 0.1 * norm(work_.head(n_)));
    }
    report.rounding = (t1_ - t0_) * rounding;
    if (!(report.rounding > kMuchRounding)) report.rounding = 0.0;
  }

  /// A hundredth of the time in which the state would change by its own size; Hairer, Norsett, Wanner 1993, II.4.
  double first_guess() const {
    if (n_ == 0) return std::numeric_limits<double>::max();
    const auto scale = absolute_ + options_.relative_tolerance * z0_.head(n_).abs();
    const double size = std::sqrt((z0_.head(n_) / scale).square().mean());
    const double rate = std::sqrt((k_.col(0).head(n_) / scale).square().mean());
    const double h = 0.01 * size / rate;
    return size < 1e-5 || rate < 1e-5 || !(h > 0.0 && std::isfinite(h)) ? 1e-6 : h;  // squares of tiny tolerances overflow
  }

  /// The state at a trial time is that of a step which ends there: as accurate as any other step. false: the length of the first step after
  /// a start is none of what acts now, the stages of all of it may have gone past something as short as a contact, and the step to the
  /// event, which meets it, is not accurate; h_ is shorter now.
  bool find_event(StepReport& report) {
    const double whole = t1_;
    const auto state_at = [this](double t) {
      if (t == t1_) return z1_.data();
      must_step(t);
      if constexpr (Method::adaptive) doubtful_ = doubtful_ || !(error_norm(t1_ - t0_) <= kDoubtful);
      return z1_.data();
    };
    const auto inside = [this, whole](double t) {
      if (t1_ != whole) must_step(whole);
      dense_output(t);
      if (problem_.project) problem_.project(t, work_.data());
      return work_.data();
    };
    const auto beside = [this](double t, double dt) {
      work_.head(n_) = t == t1_ ? z1_.head(n_) + dt * last_slope().head(n_) : z0_.head(n_) + dt * first_slope().head(n_);
      return work_.data();
    };
    const auto roughly = [this, whole](double t) {
      if (t1_ != whole) must_step(whole);
      cubic((t - t0_) / (t1_ - t0_));
      if (problem_.project) problem_.project(t, work_.data());
      return work_.data();
    };
    double t = t1_;
    doubtful_ = false;
    if (events_.find(t, state_at, inside, beside, roughly)) {
      report.event = true;
      report.crossed = events_.crossed();
    }
    state_at(t);
    if constexpr (Method::adaptive) {
      if (doubtful_ && doubts_ > 0) {
        --doubts_;
        count_rejection(statistics_.rejected, problem_, largest_of(share_.data(), n_));
        h_ = 0.2 * (whole - t0_);
        events_.take_back();
        report.event = false;
        return false;
      }
      if (t == whole || tries_ == 0) return true;
      error_ = error_norm(t1_ - t0_);
      const bool accurate = !(error_ > 1.0), first = tries_ == kTries && !events_.at_corners() && t - t0_ > 1e-6 * (whole - t0_);
      if (accurate && !first) return true;
      --tries_;
      if (!accurate) count_rejection(statistics_.rejected, problem_, largest_of(share_.data(), n_));
      h_ = (accurate ? 0.25 : std::max(0.2, change_by(error_))) * (t1_ - t0_);  // a stage may be what alone felt it, and weighs nothing
      events_.take_back();
      report.event = false;
      return false;
    }
    return true;
  }

  OdeProblem problem_;
  IntegratorOptions options_;
  EventFinder events_;
  NodeQuadrature nodes_;
  bool staged_ = true;    // the integrals are in z1_, else in nodes_
  bool complete_ = true;  // all stages of the last step are there
  int n_, n_all_;
  double t0_ = 0.0, t1_ = 0.0;  // [s] of the last step
  double h_ = 0.0;              // [s] adaptive: the next step to try
  double error_ = 0.0;          // adaptive: of the last step, over what is allowed
  int tries_ = 0, doubts_ = 0;  // that are left
  bool doubtful_ = false;       // an accurate step went past what its looks inside have met, or one of their stages alone
  bool started_ = false, slope_known_ = false;
  int at_the_limit_ = 0, inside_ = 0;             // steps: of stability; since then not
  Eigen::ArrayXd z0_, z1_, work_, inner_, zero_;  // states and integrals: step begin, step end, trial, scratch; zeros
  Eigen::ArrayXd share_;                          // of each state in the last norm
  Eigen::ArrayXd staged_error_, all_error_;       // of integrals: since the last restart, by stages; of all before it
  int worst_ = -1;                                // the largest of them
  Eigen::ArrayXXd k_;                             // slopes, one column per stage
  Eigen::ArrayXd absolute_, weight_;              // weight_: of groups, or empty
  IntegratorStatistics statistics_;
};

}  // namespace

std::unique_ptr<Integrator> make_rk4(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<RungeKutta<Rk4>>(std::move(problem), options);
}

std::unique_ptr<Integrator> make_dop853(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<RungeKutta<Dop853>>(std::move(problem), options);
}

std::unique_ptr<Integrator> make_dopri5(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<RungeKutta<Dopri5>>(std::move(problem), options);
}

}  // namespace cardan
