#include "scripts/import/assemble.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"

namespace cardan {
namespace {

using Kind = RobotJoint::Kind;
constexpr double kAngle = 1e-9;  // between directions that count as the same
constexpr int kGone = -2;

Vec3<double> unit_of(const Vec3<double>& a) { return 1.0 / length(a) * a; }

/// The joints of a link, seen from a frame that stands at `X` in it.
std::vector<RobotJoint> seen_from(const Pose<double>& X, std::vector<RobotJoint> joints) {
  const Pose<double> back = inverse(X);
  for (RobotJoint& j : joints) {
    j.axis = back.R * j.axis;
    j.point = back.p + back.R * j.point;
  }
  return joints;
}

class Assembler {
 public:
  Assembler(Robot& robot, RobotSource& source) : robot_(robot), source_(source) {}

  Assembled assemble() {
    join_massless();
    source_.sink.throw_if_any();
    order();
    carry();
    if (out_.bodies.empty() && !robot_.links.empty())
      source_.report_at(Code::empty_system, {fmt::format("{} {}", link(0).what, called(0)), link(0).mark}, "something that has mass",
                        "none");
    source_.sink.throw_if_any();
    return std::move(out_);
  }

 private:
  RobotLink& link(int k) { return robot_.links[static_cast<std::size_t>(k)]; }
  bool has_mass(int k) { return link(k).inertial.has_value(); }
  std::string called(int k) { return in_quotes(link(k).name); }
  void cannot(int k, std::string expected, std::string got, std::string hint) {
    source_.report_at(Code::not_imported, {fmt::format("{} {}", link(k).what, called(k)), link(k).mark}, std::move(expected),
                      std::move(got), std::move(hint));
  }

  // ---- links without mass on joints ----

  void join_massless() {
    const int n = static_cast<int>(robot_.links.size());
    std::vector<std::vector<int>> children(static_cast<std::size_t>(n));
    for (int k = 0; k < n; ++k)
      if (link(k).parent >= 0) children[static_cast<std::size_t>(link(k).parent)].push_back(k);
    std::vector<std::uint8_t> held(static_cast<std::size_t>(n));  // by a loop
    for (const RobotClosure& c : robot_.closures)
      for (const auto* end : {&c.from, &c.to})
        if (end->link >= 0) held[static_cast<std::size_t>(end->link)] = 1;
    gone_.assign(static_cast<std::size_t>(n), 0);
    for (int k = 0; k < n; ++k) {  // a chain that was handed on is looked at again at the next link
      if (gone_[static_cast<std::size_t>(k)] || has_mass(k) || link(k).joints.empty()) continue;
      // What is fixed to it, in the order of the file, and what moves on that.
      std::vector<int> group{k}, moving;
      std::vector<Pose<double>> poses{{}};
      int heavy = -1;
      Pose<double> of_heavy;
      for (std::size_t i = 0; i < group.size() && heavy < 0; ++i)
        for (const int c : children[static_cast<std::size_t>(group[i])]) {
          if (!link(c).joints.empty()) {
            moving.push_back(c);
            continue;
          }
          if (has_mass(c)) {
            heavy = c, of_heavy = poses[i] * link(c).place.X;
            break;
          }
          group.push_back(c);
          poses.push_back(poses[i] * link(c).place.X);
        }
      if (heavy >= 0) {  // which takes the hinge; the other becomes a place on it
        RobotLink &h = link(heavy), &m = link(k);
        h.joints = seen_from(of_heavy, std::move(m.joints));
        h.place = {m.place.X * of_heavy, {}};
        h.parent = m.parent;
        m.joints.clear();
        m.parent = heavy;
        m.place = {inverse(of_heavy), {}};
        continue;
      }
      hand_on(k, group, moving, held);
    }
  }

  void hand_on(int k, const std::vector<int>& group, const std::vector<int>& moving, const std::vector<std::uint8_t>& held) {
    const RobotLink& m = link(k);
    const bool base = m.joints.front().kind == Kind::free;
    if (moving.empty() && !base && source_.asked_to_leave_out(m.name, {})) {
      for (const int g : group) gone_[static_cast<std::size_t>(g)] = 1;
      return;
    }
    if (moving.size() != 1 || base)
      return cannot(k, fmt::format("a {} with mass where it moves", m.what),
                    base             ? "a free base that has none"
                    : moving.empty() ? "one that has none, nor has anything on it"
                                     : fmt::format("one that has none, with {} joints on it", moving.size()),
                    base             ? "--base fixed holds it to the world"
                    : moving.empty() ? fmt::format("--leave-out {} does without it; or give it its mass", in_quotes(m.name))
                                     : "give it its mass");
    for (const int g : group) {
      if (held[static_cast<std::size_t>(g)])
        return cannot(g, "loops that hold what has mass", "one that holds it between two joints", "give it its mass");
      for (std::size_t i = 0; i < link(g).sites.size(); ++i) source_.leave("site between two joints");
      gone_[static_cast<std::size_t>(g)] = 1;
    }
    const int next = moving[0];
    Pose<double> X = link(next).place.X;
    for (int g = link(next).parent; g != k; g = link(g).parent) X = link(g).place.X * X;
    RobotLink& to = link(next);
    std::vector<RobotJoint> joints = seen_from(X, m.joints);
    joints.insert(joints.end(), to.joints.begin(), to.joints.end());
    to.joints = std::move(joints);
    to.place = {m.place.X * X, {}};
    to.parent = m.parent;
  }

  // ---- bodies ----

  /// Inboard before outboard again; the links of the robot keep their numbers.
  void order() {
    const int n = static_cast<int>(robot_.links.size());
    std::vector<std::vector<int>> children(static_cast<std::size_t>(n) + 1);
    for (int k = n - 1; k >= 0; --k)
      if (!gone_[static_cast<std::size_t>(k)]) children[static_cast<std::size_t>(link(k).parent + 1)].push_back(k);
    for (std::vector<int> todo = children[0]; !todo.empty();) {
      const int k = todo.back();
      todo.pop_back();
      order_.push_back(k);
      const auto& more = children[static_cast<std::size_t>(k) + 1];
      todo.insert(todo.end(), more.begin(), more.end());
    }
  }

  void carry() {
    out_.carriers.assign(robot_.links.size(), {kGone, {}});
    for (const int k : order_) {
      const RobotLink& l = link(k);
      const Carrier inboard = l.parent < 0 ? Carrier{} : out_.carriers[static_cast<std::size_t>(l.parent)];
      const RobotPlace place = l.parent < 0 || is_origin(inboard.place.X) ? l.place : RobotPlace{inboard.place.X * l.place.X, {}};
      Carrier& mine = out_.carriers[static_cast<std::size_t>(k)];
      if (!l.inertial) {
        mine = {inboard.body, place};
        if (mine.body >= 0) out_.bodies[static_cast<std::size_t>(mine.body)].nodes.push_back({l.name, l.what, place, l.mark});
      } else {
        mine = {static_cast<int>(out_.bodies.size()), {}};
        RobotBody& body = out_.bodies.emplace_back();
        body.link = &l;
        body.hinge = hinge_of(k, place, inboard.body);
        for (std::size_t j = 0; j < l.joints.size(); ++j) out_.coordinates[l.joints[j].id] = {mine.body, static_cast<int>(j)};
      }
      if (mine.body < 0) {
        for (std::size_t i = 0; i < l.sites.size(); ++i) source_.leave("site");
        continue;
      }
      for (RobotSite site : l.sites) {
        if (!is_origin(mine.place.X)) site.place = {mine.place.X * site.place.X, {}};
        out_.bodies[static_cast<std::size_t>(mine.body)].nodes.push_back(std::move(site));
      }
    }
  }

  static bool is_origin(const Pose<double>& X) {
    const Mat3<double>& R = X.R;
    return X.p.x == 0 && X.p.y == 0 && X.p.z == 0 && R.xx == 1 && R.yy == 1 && R.zz == 1 && R.xy == 0 && R.xz == 0 && R.yx == 0 &&
           R.yz == 0 && R.zx == 0 && R.zy == 0;
  }

  RobotHinge hinge_of(int k, const RobotPlace& place, int inboard) {
    const std::vector<RobotJoint>& joints = link(k).joints;
    RobotHinge h;
    h.inboard = inboard;
    h.to = place;
    const auto through = [&](const Vec3<double>& point) {  // both nodes stand there
      h.at.X.p = point;
      if (point.x != 0 || point.y != 0 || point.z != 0) h.to.X.p = place.X.p + place.X.R * point;
    };
    const auto fits = [&](const char* type, std::vector<std::string> coordinates, std::string parameters) {
      h.type = type;
      h.coordinates = std::move(coordinates);
      h.parameters = std::move(parameters);
      return h;
    };
    const auto kinds = [&](std::initializer_list<Kind> wanted) {
      return std::ranges::equal(joints, wanted, {}, [](const RobotJoint& j) { return j.kind; });
    };
    if (joints.empty()) return fits("locked", {}, "");
    const RobotJoint& first = joints[0];
    for (const RobotJoint& j : joints)
      if (!(length(j.axis) > 0)) {
        source_.report_at(Code::bad_axes, {fmt::format("joint {}", in_quotes(j.name)), j.axis_mark}, "an axis that is not zero",
                          list_of(j.axis));
        return fits("locked", {}, "");
      }
    if (joints.size() == 1) {
      through(first.kind == Kind::hinge || first.kind == Kind::ball ? first.point : Vec3<double>{});
      if (first.kind == Kind::hinge) return fits("revolute", {"angle"}, "axis: " + list_of(first.axis));
      if (first.kind == Kind::slide) return fits("prismatic", {"displacement"}, "axis: " + list_of(first.axis));
      if (first.kind == Kind::ball) return fits("ball", {""}, "");
      if (first.kind == Kind::free) return fits("free", {""}, "");
      const Vec3<double> n = unit_of(first.axis);
      const Vec3<double> some = std::abs(n.x) > 0.9 ? Vec3<double>{0, 1, 0} : Vec3<double>{1, 0, 0};
      const Vec3<double> e1 = unit_of(some - dot(some, n) * n);
      return fits("planar", {""}, fmt::format("axes: [{}, {}]", list_of(e1), list_of(cross(n, e1))));
    }
    if (kinds({Kind::hinge, Kind::hinge}) || kinds({Kind::hinge, Kind::hinge, Kind::hinge})) {
      Vec3<double> point;
      if (common_point(joints, point)) {
        through(point);
        std::string axes;
        for (const RobotJoint& j : joints) axes += (axes.empty() ? "" : ", ") + list_of(j.axis);
        if (joints.size() == 2) return fits("universal", {"angle_1", "angle_2"}, fmt::format("axes: [{}]", axes));
        return fits("gimbal", {"angle_1", "angle_2", "angle_3"}, fmt::format("axes: [{}]", axes));
      }
    }
    const auto same = [](const Vec3<double>& a, const Vec3<double>& b) { return length(unit_of(a) - unit_of(b)) < kAngle; };
    if ((kinds({Kind::hinge, Kind::slide}) || kinds({Kind::slide, Kind::hinge})) && same(joints[0].axis, joints[1].axis)) {
      const bool turns_first = first.kind == Kind::hinge;
      through((turns_first ? joints[0] : joints[1]).point);
      return fits("cylindrical",
                  turns_first ? std::vector<std::string>{"angle", "displacement"} : std::vector<std::string>{"displacement", "angle"},
                  "axis: " + list_of((turns_first ? joints[0] : joints[1]).axis));
    }
    if (joints.size() == 3 && first.kind == Kind::slide && joints[1].kind == Kind::slide) {
      const Vec3<double> a = unit_of(first.axis), b = unit_of(joints[1].axis), c = unit_of(joints[2].axis);
      if (std::abs(dot(a, b)) < kAngle && same(cross(a, b), c)) {
        if (joints[2].kind == Kind::hinge) {
          through(joints[2].point);
          return fits("planar", {"x", "y", "angle"}, fmt::format("axes: [{}, {}]", list_of(a), list_of(b)));
        }
        if (joints[2].kind == Kind::slide) {
          const Mat3<double> R{a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z};
          h.at.X.R = R;
          h.to = {{place.X.R * R, place.X.p}, {}};
          return fits("translational", {"x", "y", "z"}, "");
        }
      }
    }
    std::string chain;
    for (const RobotJoint& j : joints) chain += fmt::format("{}{}", chain.empty() ? "" : ", ", kWords[static_cast<std::size_t>(j.kind)]);
    cannot(k,
           "joints that are one hinge: two or three that turn about axes through one point; two or three slides at right angles and one "
           "that turns "
           "about their normal, or slides along it; one that turns about the axis along which another slides",
           chain, fmt::format("give each {} between them a mass", link(k).what));
    return fits("locked", {}, "");
  }

  /// Where all axes meet.
  static bool common_point(const std::vector<RobotJoint>& joints, Vec3<double>& point) {
    const RobotJoint &a = joints[0], &b = joints[1];
    const Vec3<double> u = unit_of(a.axis), w = unit_of(b.axis), d = b.point - a.point, n = cross(u, w);
    const double nn = dot(n, n);
    if (!(nn > kAngle)) {  // parallel neighbours: no hinge has such axes
      point = a.point;
      return false;
    }
    point = a.point + (dot(cross(d, w), n) / nn) * u;
    double size = 1e-3 + length(d);
    if (length(d) == 0) point = a.point;
    for (const RobotJoint& j : joints) {
      size += length(j.point - a.point);
      const Vec3<double> away = point - j.point;
      if (!(length(cross(away, unit_of(j.axis))) < 1e-9 * size)) return false;
    }
    return true;
  }

  static constexpr const char* kWords[] = {"hinge", "slide", "ball", "planar", "free"};
  Robot& robot_;
  RobotSource& source_;
  Assembled out_;
  std::vector<std::uint8_t> gone_;
  std::vector<int> order_;
};

}  // namespace

Assembled assemble(Robot& robot, RobotSource& source) { return Assembler(robot, source).assemble(); }

}  // namespace cardan
