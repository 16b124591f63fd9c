// URDF: a tree of links on joints, `mimic`, and what research codes add for closed loops.
#include <fmt/format.h>

#include <cmath>
#include <map>

#include "core/base/units.hpp"
#include "scripts/import/source.hpp"

namespace cardan {
namespace {

using Kind = RobotJoint::Kind;

/// A joint element before the tree is known.
struct UrdfJoint {
  const XmlElement* element;
  std::string name, type;
  int parent = -1, child = -1;
  RobotPlace origin{};
  RobotJoint joint{};
};

struct Mimic {
  const XmlElement* element;
  int joint;  // in joints_
};

class UrdfReader {
 public:
  UrdfReader(const XmlElement& root, RobotSource& source) : root_(root), source_(source) {}

  Robot read() {
    robot_.format = "URDF";
    robot_.file = source_.file;
    robot_.name = std::string(root_.called());
    source_.expect_attributes(root_, "name version",
                              "xmlns:xacro xmlns:gazebo xmlns:sensor xmlns:controller xmlns:interface xmlns:drake "
                              "xmlns:xsi xmlns xsi:schemaLocation");
    for (const XmlElement& e : root_.children) read_top(e);
    for (const XmlElement& e : root_.children)
      if (e.name == "joint") read_joint(e);
    source_.sink.throw_if_any();
    build_tree();
    for (const Mimic& m : mimics_) read_mimic(m);
    for (const XmlElement& e : root_.children) read_closure(e);
    return std::move(robot_);
  }

 private:
  // ---- links ----

  void read_top(const XmlElement& e) {
    if (e.name == "link") return read_link(e);
    if (e.name == "joint" || is_word_of(kClosures, e.name)) return;
    if (is_word_of("material gazebo transmission sensor ros2_control", e.name)) return source_.leave(e.name);
    unknown(e);
  }

  void unknown(const XmlElement& e) {
    source_.cannot(e, e.name, "elements of URDF",
                   e.name.starts_with("xacro:") ? "expand macros first: xacro robot.xacro > robot.urdf" : "");
  }

  void read_link(const XmlElement& e) {
    source_.expect_attributes(e, "name", "type concave");
    RobotLink link;
    link.name = source_.text({e}, "name");
    link.mark = e.mark;
    if (!links_.emplace(link.name, static_cast<int>(robot_.links.size())).second)
      source_.report(Code::duplicate_name, e, "name", "a name of its own for each link", in_quotes(link.name));
    for (const XmlElement& child : e.children) {
      if (child.name == "inertial") {
        if (link.inertial)
          source_.report(Code::duplicate_key, child, {}, "one inertial", "a second");
        else
          link.inertial = read_inertial(child);
      } else if (is_word_of("visual collision sensor contact material self_collision_checking verbose", child.name)) {
        source_.leave(child.name);
      } else {
        unknown(child);
      }
    }
    robot_.links.push_back(std::move(link));
  }

  const XmlElement* only(const XmlElement& e, std::string_view name) {
    const XmlElement* found = nullptr;
    for (const XmlElement& child : e.children) {
      if (child.name != name) continue;
      if (found) source_.report(Code::duplicate_key, child, {}, fmt::format("one {}", name), "a second");
      found = &child;
    }
    return found;
  }

  void expect_children(const XmlElement& e, std::string_view known, std::string_view ignored = {}) {
    for (const XmlElement& child : e.children) {
      if (is_word_of(known, child.name)) continue;
      if (is_word_of(ignored, child.name))
        source_.leave(child.name);
      else
        unknown(child);
    }
  }

  RobotPlace read_origin(const XmlElement* e) {
    if (!e) return {};
    source_.expect_attributes(*e, "xyz rpy");
    const Vec3<double> none{}, rpy = source_.vector({*e}, "rpy", none);
    RobotPlace out{{rotation_of_rpy(rpy), source_.vector({*e}, "xyz", none)}, {}};
    if (rpy.x != 0 || rpy.y != 0 || rpy.z != 0)
      out.written = fmt::format("{{euler: {{sequence: zyx, angles: [{}, {}, {}]}}}}", rpy.z + 0.0, rpy.y + 0.0, rpy.x + 0.0);
    return out;
  }

  RobotInertial read_inertial(const XmlElement& e) {
    expect_children(e, "origin mass inertia");
    RobotInertial out;
    const RobotPlace origin = read_origin(only(e, "origin"));
    out.com = origin.X.p;
    out.mass_mark = out.inertia_mark = e.mark;
    if (const XmlElement* mass = only(e, "mass")) {
      source_.expect_attributes(*mass, "value");
      out.mass = source_.number({*mass}, "value", std::nullopt);
      out.mass_mark = mass->mark;
    } else {
      source_.report(Code::missing_key, e, {}, "<mass value=\"...\"/>", "no such element");
    }
    if (const XmlElement* inertia = only(e, "inertia")) {
      source_.expect_attributes(*inertia, "ixx iyy izz ixy ixz iyz");
      const auto entry = [&](const char* name, std::optional<double> otherwise) { return source_.number({*inertia}, name, otherwise); };
      const Sym3<double> J{entry("ixx", {}), entry("iyy", {}), entry("izz", {}), entry("ixy", 0.0), entry("ixz", 0.0), entry("iyz", 0.0)};
      out.J = origin.written.empty() ? J : rotate(origin.X.R, J);
      out.inertia_mark = inertia->mark;
    } else {
      source_.report(Code::missing_key, e, {}, "<inertia ixx=\"...\" iyy=\"...\" izz=\"...\"/>", "no such element");
    }
    return out;
  }

  // ---- joints ----

  int link_of(const XmlElement& e, std::string_view attribute) {
    const std::string name = source_.text({e}, attribute);
    if (name.empty()) return -1;
    const auto found = links_.find(name);
    if (found != links_.end()) return found->second;
    if (source_.sink.full()) return -1;
    std::vector<std::string> legal;
    for (const auto& [known, index] : links_)
      if (legal.size() < 1000) legal.push_back(known);
    source_.report(Code::unknown_name, e, attribute, "the name of a link", in_quotes(name), did_you_mean(name, legal));
    return -1;
  }
  int end_of(const XmlElement& joint, const char* name) {
    const XmlElement* e = only(joint, name);
    if (!e) {
      source_.report(Code::missing_key, joint, {}, fmt::format("<{} link=\"...\"/>", name), "no such element");
      return -1;
    }
    source_.expect_attributes(*e, "link");
    return link_of(*e, "link");
  }

  void read_joint(const XmlElement& e) {
    source_.expect_attributes(e, "name type", "independent");
    expect_children(e, "parent child origin axis limit dynamics mimic", "calibration safety_controller hardwareInterface");
    UrdfJoint j{&e, source_.text({e}, "name"), source_.text({e}, "type")};
    if (!j.name.empty() && !joint_names_.emplace(j.name, static_cast<int>(joints_.size())).second)
      source_.report(Code::duplicate_name, e, "name", "a name of its own for each joint", in_quotes(j.name));
    j.parent = end_of(e, "parent");
    j.child = end_of(e, "child");
    j.origin = read_origin(only(e, "origin"));
    RobotJoint& joint = j.joint;
    joint.name = j.name;
    joint.mark = joint.axis_mark = e.mark;
    joint.id = static_cast<int>(joints_.size());
    const XmlElement* axis = only(e, "axis");
    if (axis) {
      source_.expect_attributes(*axis, "xyz");
      joint.axis = source_.vector({*axis}, "xyz", std::nullopt);
      joint.axis_mark = axis->mark;
    }
    read_type(e, j);
    read_limit(only(e, "limit"), j);
    if (const XmlElement* dynamics = only(e, "dynamics")) {
      source_.expect_attributes(*dynamics, "damping friction");
      joint.damping = source_.number({*dynamics}, "damping", 0.0);
      joint.friction = source_.number({*dynamics}, "friction", 0.0);
      if (j.type == "fixed") joint.damping = joint.friction = 0.0;
      const bool several = is_word_of("floating planar", j.type);
      if (several && (joint.damping != 0 || joint.friction != 0) &&
          source_.cannot(*dynamics, "dynamics", "damping and friction of joints with one coordinate"))
        joint.damping = joint.friction = 0.0;
      if (joint.kind == Kind::ball && joint.friction != 0 &&
          source_.cannot(*dynamics, "friction", "friction of joints with one coordinate"))
        joint.friction = 0.0;
    }
    if (const XmlElement* mimic = only(e, "mimic")) mimics_.push_back({mimic, static_cast<int>(joints_.size())});
    joints_.push_back(std::move(j));
  }

  void read_type(const XmlElement& e, UrdfJoint& j) {
    static const std::map<std::string, Kind> kinds{{"revolute", Kind::hinge}, {"continuous", Kind::hinge}, {"prismatic", Kind::slide},
                                                   {"floating", Kind::free},  {"planar", Kind::planar},    {"spherical", Kind::ball},
                                                   {"ball", Kind::ball}};
    if (j.type == "fixed" || j.type.empty()) return;
    if (const auto found = kinds.find(j.type); found != kinds.end()) {
      j.joint.kind = found->second;
      return;
    }
    source_.report(Code::not_imported, e, "type", "fixed, revolute, continuous, prismatic, floating, planar, spherical", in_quotes(j.type),
                   did_you_mean(j.type, {"fixed", "revolute", "continuous", "prismatic", "floating", "planar", "spherical"}));
  }

  void read_limit(const XmlElement* e, UrdfJoint& j) {
    if (!e) return;
    source_.expect_attributes(*e, "lower upper effort velocity", "acceleration jerk deceleration");
    const XmlView v{*e};
    const bool limited = j.type == "revolute" || j.type == "prismatic";
    if (limited && (v.find("lower") || v.find("upper"))) {
      j.joint.lower = source_.number(v, "lower", 0.0);
      j.joint.upper = source_.number(v, "upper", 0.0);
      if (!(*j.joint.lower <= *j.joint.upper))
        source_.report(Code::out_of_range, *e, "upper", fmt::format("at least lower, {:g}", *j.joint.lower),
                       fmt::format("{:g}", *j.joint.upper));
    }
    for (const char* name : {"effort", "velocity"})
      if (v.find(name)) j.joint.remark += fmt::format("{}{} {}", j.joint.remark.empty() ? "" : ", ", name, source_.number(v, name, 0.0));
  }

  // ---- the tree ----

  void build_tree() {
    const std::size_t n = robot_.links.size();
    if (n == 0) {
      source_.report(Code::empty_system, root_, {}, "at least one link", "none");
      source_.sink.throw_if_any();
    }
    std::vector<int> inboard(n, -1);  // joint
    std::vector<std::vector<int>> outboard(n);
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      const UrdfJoint& j = joints_[i];
      int& one = inboard[static_cast<std::size_t>(j.child)];
      if (one >= 0)
        source_.report(Code::two_parents, *j.element, {}, "one joint to the parent of each link",
                       fmt::format("{} is the child of {} and of {}", in_quotes(robot_.links[static_cast<std::size_t>(j.child)].name),
                                   in_quotes(joints_[static_cast<std::size_t>(one)].name), in_quotes(j.name)),
                       "what closes a loop is no joint: <loop>, or <constraint>");
      else
        one = static_cast<int>(i), outboard[static_cast<std::size_t>(j.parent)].push_back(static_cast<int>(i));
    }
    source_.sink.throw_if_any();
    std::vector<int> roots, order, place(n, -1);
    for (std::size_t i = 0; i < n; ++i)
      if (inboard[i] < 0) roots.push_back(static_cast<int>(i));
    if (roots.size() > 1) {
      const XmlElement* second = element_of(roots[1]);
      source_.report(Code::several_roots, *second, {}, "one link that is no child",
                     fmt::format("{} of them: {}, {}{}", roots.size(), in_quotes(robot_.links[static_cast<std::size_t>(roots[0])].name),
                                 in_quotes(robot_.links[static_cast<std::size_t>(roots[1])].name), roots.size() > 2 ? ", ..." : ""),
                     "a fixed joint holds one to the other");
      source_.sink.throw_if_any();
    }
    order = roots;
    for (std::vector<int> todo = roots; !todo.empty();) {  // inboard before outboard, joints in the order of the file
      const int k = todo.back();
      todo.pop_back();
      if (place[static_cast<std::size_t>(k)] >= 0) continue;
      place[static_cast<std::size_t>(k)] = 0;
      if (inboard[static_cast<std::size_t>(k)] >= 0) order.push_back(k);
      const auto& children = outboard[static_cast<std::size_t>(k)];
      for (auto i = children.rbegin(); i != children.rend(); ++i) todo.push_back(joints_[static_cast<std::size_t>(*i)].child);
    }
    if (order.size() < n) {
      std::size_t lost = 0;
      while (place[lost] >= 0) ++lost;
      source_.report(Code::cycle, *joints_[static_cast<std::size_t>(inboard[lost])].element, {},
                     "joints that lead from one root to every link",
                     fmt::format("{} is its own ancestor", in_quotes(robot_.links[lost].name)),
                     "what closes a loop is no joint: <loop>, or <constraint>");
      source_.sink.throw_if_any();
    }
    std::vector<RobotLink> links;
    for (std::size_t i = 0; i < order.size(); ++i) place[static_cast<std::size_t>(order[i])] = static_cast<int>(i);
    for (const int k : order) {
      RobotLink link = std::move(robot_.links[static_cast<std::size_t>(k)]);
      if (const int i = inboard[static_cast<std::size_t>(k)]; i >= 0) {
        UrdfJoint& j = joints_[static_cast<std::size_t>(i)];
        link.parent = place[static_cast<std::size_t>(j.parent)];
        link.place = j.origin;
        if (j.type != "fixed") link.joints.push_back(j.joint);
      }
      links.push_back(std::move(link));
    }
    robot_.links = std::move(links);
    for (auto& [name, index] : links_) index = place[static_cast<std::size_t>(index)];
    robot_.n_joints = static_cast<int>(joints_.size());
    read_base();
  }

  const XmlElement* element_of(int link) const {
    int i = 0;
    for (const XmlElement& e : root_.children)
      if (e.name == "link" && i++ == link) return &e;
    return &root_;
  }

  void read_base() {
    RobotLink& base = robot_.links[0];
    using Base = ImportOptions::Base;
    const Base asked = source_.options.base;
    const bool free = asked == Base::free || (asked == Base::automatic && base.inertial && base.name != "world");
    if (asked == Base::automatic && (base.inertial || base.name != "world"))
      source_.note(fmt::format("the root link {} {}", in_quotes(base.name),
                               free ? "is free: --base fixed holds it to the world" : "is held to the world: --base free lets it go"));
    if (!free) return;
    RobotJoint joint;
    joint.kind = Kind::free;
    joint.id = robot_.n_joints++;
    joint.mark = joint.axis_mark = base.mark;
    base.joints = {joint};
  }

  // ---- loops ----

  /// The joint with this name, of one coordinate; null after a fault.
  const UrdfJoint* coordinate(const XmlElement& e, std::string_view attribute, const std::string& name) {
    const auto found = joint_names_.find(name);
    if (found == joint_names_.end()) {
      if (source_.sink.full()) return nullptr;
      std::vector<std::string> legal;
      for (const auto& [known, index] : joint_names_)
        if (legal.size() < 1000) legal.push_back(known);
      source_.report(Code::unknown_name, e, attribute, "the name of a joint", in_quotes(name), did_you_mean(name, legal));
      return nullptr;
    }
    const UrdfJoint& j = joints_[static_cast<std::size_t>(found->second)];
    if (has_coordinate(j)) return &j;
    source_.report(Code::not_imported, e, attribute, "a joint with one coordinate", fmt::format("{}, {}", in_quotes(name), j.type));
    return nullptr;
  }
  static bool has_coordinate(const UrdfJoint& j) {
    return j.type != "fixed" && (j.joint.kind == Kind::hinge || j.joint.kind == Kind::slide);
  }

  void read_mimic(const Mimic& m) {
    const XmlElement& e = *m.element;
    const UrdfJoint& j = joints_[static_cast<std::size_t>(m.joint)];
    source_.expect_attributes(e, "joint multiplier offset");
    if (source_.asked_to_leave_out("mimic", j.name)) return;
    const UrdfJoint* other = coordinate(e, "joint", source_.text({e}, "joint"));
    if (!other) return;
    if (!has_coordinate(j)) {
      source_.report(Code::not_imported, e, {}, "a mimic of a joint with one coordinate", fmt::format("{}, {}", in_quotes(j.name), j.type));
      return;
    }
    RobotClosure c;
    c.name = j.name;
    c.what = "mimic of joint";
    c.type = "coupling";
    c.mark = e.mark;
    c.offset = source_.number({e}, "offset", 0.0);
    c.dependent = j.joint.id;
    c.terms = {{j.joint.id, 1.0}, {other->joint.id, -source_.number({e}, "multiplier", 1.0)}};
    if (other == &j) source_.report(Code::cycle, e, "joint", "another joint", fmt::format("{} itself", in_quotes(j.name)));
    add_closure(std::move(c));
  }

  void add_closure(RobotClosure c) {
    std::erase_if(c.terms, [](const auto& term) { return term.second == 0.0; });
    robot_.closures.push_back(std::move(c));
  }

  void read_closure(const XmlElement& e) {
    if (!is_word_of(kClosures, e.name)) return;
    const bool by_parent = e.name == "loop_constraint" || e.name == "joint_constraint", by_number = e.name == "loop_joint";
    const char* const first = by_number ? "link1" : by_parent ? "parent" : "predecessor";
    const char* const second = by_number ? "link2" : by_parent ? "child" : "successor";
    if (source_.asked_to_leave_out(e.name, e.called())) return;
    source_.expect_attributes(e, "name type");
    RobotClosure c;
    c.name = std::string(e.called());
    c.what = e.name;
    c.mark = e.mark;
    const XmlAttribute* type = e.attribute("type");
    const bool couples =
        e.name == "coupling" || e.name == "joint_constraint" || (e.name == "constraint" && type && type->value == "rolling");
    expect_children(e, fmt::format("{} {} {}", first, second,
                                   couples     ? (by_parent ? "gear_ratio" : "ratio")
                                   : by_parent ? "parent_origin child_origin"
                                               : "axis"));
    const XmlElement *a = only(e, first), *b = only(e, second);
    for (const auto& [element, name] : {std::pair(a, first), std::pair(b, second)})
      if (!element) source_.report(Code::missing_key, e, {}, fmt::format("<{} link=\"...\"/>", name), "no such element");
    if (!a || !b) return;
    for (const XmlElement* end : {a, b}) {
      source_.expect_attributes(*end, by_number ? "link xyz rpy" : "link");
      expect_children(*end, couples || by_parent || by_number ? "" : "origin");
    }
    c.from.link = link_of(*a, "link");
    c.to.link = link_of(*b, "link");
    if (c.from.link < 0 || c.to.link < 0) return;
    if (couples) return read_coupling(e, std::move(c), only(e, by_parent ? "gear_ratio" : "ratio"));

    if (by_parent) {
      c.from.place = read_origin(only(e, "parent_origin")), c.to.place = read_origin(only(e, "child_origin"));
    } else if (by_number) {
      const Vec3<double> none{};
      for (const auto& [element, end] : {std::pair(a, &c.from), std::pair(b, &c.to)})
        end->place.X = {rotation_of_rpy(source_.vector({*element}, "rpy", none)), source_.vector({*element}, "xyz", none)};
    } else {
      c.from.place = read_origin(only(*a, "origin")), c.to.place = read_origin(only(*b, "origin"));
    }
    static const std::map<std::string, std::string> types{
        {"revolute", "revolute"}, {"continuous", "revolute"}, {"prismatic", "prismatic"}, {"spherical", "point"},
        {"ball", "point"},        {"position", "point"},      {"fixed", "weld"},          {"cylindrical", "cylindrical"}};
    const std::string asked = type ? type->value : by_parent ? "position" : source_.text({e}, "type");
    const auto found = types.find(asked);
    if (found == types.end()) {
      if (!asked.empty())
        source_.report(Code::not_imported, e, "type", "revolute, continuous, prismatic, cylindrical, spherical, position, fixed",
                       in_quotes(asked),
                       fmt::format("--leave-out {} does without it", e.called().empty() ? e.name : in_quotes(e.called())));
      return;
    }
    c.type = found->second;
    if (c.type != "point" && c.type != "weld") {
      const XmlElement* axis = only(e, "axis");
      if (axis) source_.expect_attributes(*axis, "xyz");
      c.axis = axis ? source_.vector({*axis}, "xyz", std::nullopt) : Vec3<double>{1, 0, 0};
    }
    robot_.closures.push_back(std::move(c));
  }

  /// ratio times the coordinates from the common ancestor to the predecessor = those to the successor.
  void read_coupling(const XmlElement& e, RobotClosure c, const XmlElement* ratio) {
    double r = 1.0;
    if (ratio) source_.expect_attributes(*ratio, "value"), r = source_.number({*ratio}, "value", std::nullopt);
    const auto parent = [&](int k) { return robot_.links[static_cast<std::size_t>(k)].parent; };
    bool slides = false, turns = false, others = false;
    const auto add = [&](int k, double coefficient) {
      for (const RobotJoint& j : robot_.links[static_cast<std::size_t>(k)].joints) {
        (j.kind == Kind::slide ? slides : j.kind == Kind::hinge ? turns : others) = true;
        if (++n_terms_ > kMostTerms)
          refuse(Code::not_imported, {path_of(e), e.mark}, fmt::format("couplings of at most {} joints in all", kMostTerms), "more");
        c.terms.emplace_back(j.id, coefficient);
      }
    };
    const RobotLink& successor = robot_.links[static_cast<std::size_t>(c.to.link)];
    if (!successor.joints.empty()) c.dependent = successor.joints.back().id;
    int a = c.from.link, b = c.to.link;
    while (a != b)  // inboard links have smaller numbers
      if (a > b)
        add(a, r), a = parent(a);
      else
        add(b, -1.0), b = parent(b);
    if (others || (slides && turns)) {
      source_.cannot(e, e.name, "joints of one coordinate between the two links, all turning or all sliding");
      return;
    }
    if (c.terms.empty()) {
      source_.report(Code::not_imported, e, {}, "two links that move against each other", "none moves");
      return;
    }
    c.type = "coupling";
    c.from = c.to = {};
    add_closure(std::move(c));
  }

  static constexpr std::string_view kClosures = "loop loop_joint loop_constraint coupling joint_constraint constraint";
  static constexpr int kMostTerms = 1'000'000;
  const XmlElement& root_;
  RobotSource& source_;
  Robot robot_;
  int n_terms_ = 0;
  std::map<std::string, int, std::less<>> links_, joint_names_;
  std::vector<UrdfJoint> joints_;
  std::vector<Mimic> mimics_;
};

}  // namespace

Robot read_urdf(const XmlElement& root, RobotSource& source) { return UrdfReader(root, source).read(); }

}  // namespace cardan
