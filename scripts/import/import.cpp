// The vehicle file: text, comments that tell where each thing came from, and the places of key paths in the robot file.
#include "scripts/import/import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>
#include <span>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "scripts/import/assemble.hpp"

namespace cardan {
namespace {

using Kind = RobotJoint::Kind;

bool is_zero(const Vec3<double>& a) { return a.x == 0 && a.y == 0 && a.z == 0; }

/// (w, x, y, z), from the largest of the four; w >= 0 where that is not zero.
std::string quaternion_of(const Mat3<double>& R) {
  const double four[] = {R.xx + R.yy + R.zz, R.xx - R.yy - R.zz, R.yy - R.xx - R.zz, R.zz - R.xx - R.yy};
  const auto k = std::ranges::max_element(four) - four;
  const double s = std::sqrt(1.0 + four[k]), f = 0.5 / s;
  double q[4];
  if (k == 0) q[0] = s / 2, q[1] = f * (R.zy - R.yz), q[2] = f * (R.xz - R.zx), q[3] = f * (R.yx - R.xy);
  if (k == 1) q[0] = f * (R.zy - R.yz), q[1] = s / 2, q[2] = f * (R.xy + R.yx), q[3] = f * (R.zx + R.xz);
  if (k == 2) q[0] = f * (R.xz - R.zx), q[1] = f * (R.xy + R.yx), q[2] = s / 2, q[3] = f * (R.yz + R.zy);
  if (k == 3) q[0] = f * (R.yx - R.xy), q[1] = f * (R.zx + R.xz), q[2] = f * (R.yz + R.zy), q[3] = s / 2;
  const double sign = q[0] < 0 ? -1.0 : 1.0;
  return fmt::format("{{quaternion_wxyz: [{}, {}, {}, {}]}}", sign * q[0] + 0.0, sign * q[1] + 0.0, sign * q[2] + 0.0, sign * q[3] + 0.0);
}

bool is_turned(const Mat3<double>& R) {
  return R.xy != 0 || R.xz != 0 || R.yx != 0 || R.yz != 0 || R.zx != 0 || R.zy != 0 || R.xx < 0 || R.yy < 0;
}

/// "position: [...], orientation: {...}", without what is zero.
std::string place_of(const RobotPlace& place) {
  std::string out;
  if (!is_zero(place.X.p)) out = "position: " + list_of(place.X.p);
  if (is_turned(place.X.R))
    out += fmt::format("{}orientation: {}", out.empty() ? "" : ", ", place.written.empty() ? quaternion_of(place.X.R) : place.written);
  return out;
}

/// joint "elbow", or what it is alone.
std::string called(const std::string& what, const std::string& name) {
  return name.empty() ? what : fmt::format("{} {}", what, in_quotes(name));
}

/// Names as vehicles have them, each once.
class Names {
 public:
  explicit Names(std::set<std::string> taken) : taken_(std::move(taken)) {}
  std::string take(std::string_view wanted, const char* otherwise) {
    std::string name;
    for (const char c : wanted.substr(0, 100)) {
      const auto u = static_cast<unsigned char>(c);
      name += u < 128 && (std::isalnum(u) || c == '_' || c == '-') ? c : '_';
    }
    if (name.empty() || name.find_first_not_of('_') == name.npos) name = otherwise;
    if (!std::isalpha(static_cast<unsigned char>(name[0]))) name = std::string(otherwise) + "_" + name;
    std::string out = name;
    for (int& i = last_[name]; !taken_.insert(out).second;) out = fmt::format("{}_{}", name, ++i == 1 ? ++i : i);
    return out;
  }

 private:
  std::set<std::string> taken_;
  std::map<std::string, int> last_;
};

class VehicleText {
 public:
  VehicleText(const Robot& robot, const Assembled& a, RobotSource& source) : robot_(robot), a_(a), source_(source) {}

  Imported write() {
    name_everything();
    find_starts();
    source_.sink.throw_if_any();
    std::string bodies;
    for (std::size_t i = 0; i < a_.bodies.size(); ++i) bodies += body_text(i);
    std::string loops;
    for (std::size_t i = 0; i < robot_.closures.size(); ++i) loops += loop_text(i);
    source_.sink.throw_if_any();
    if (source_.options.stop_stiffness.has_value() == false && n_limits_ > 0)
      source_.note(fmt::format("limits of {} are comments: --stop-stiffness K makes stops of them", joints(n_limits_)));
    if (!source_.options.friction_width && n_frictions_ > 0)
      source_.note(fmt::format("dry friction of {} is left out: --friction-width W smooths it over so much", joints(n_frictions_)));
    out_.notes = source_.notes();
    out_.yaml = header() + "\ncardan: 1\n" + fmt::format("name: {}\n", quoted(robot_.name.empty() ? "robot" : robot_.name)) + gravity();
    out_.yaml += "\nbodies:\n" + bodies;
    if (!loops.empty()) out_.yaml += "\nloops:\n" + loops;
    out_.bodies = static_cast<int>(a_.bodies.size());
    out_.loops = static_cast<int>(robot_.closures.size());
    return std::move(out_);
  }

 private:
  static std::string joints(int n) { return n == 1 ? "1 joint" : fmt::format("{} joints", n); }

  static std::string quoted(std::string_view text) {
    std::string out = "'";
    for (const char c : printable(text.substr(0, 200))) out += c == '\'' ? "''" : std::string(1, c);
    return out + "'";
  }

  std::string from(const SourceMark& mark) const {
    return fmt::format("{}:{}", printable(std::filesystem::path(mark.file).filename().string()), mark.line);
  }

  std::string header() const {
    std::string out = fmt::format("# {} {}, from {}, by cardan import. Comments tell where things stand there.\n", robot_.format,
                                  in_quotes(robot_.name), printable(std::filesystem::path(robot_.file).filename().string()));
    for (const std::string& note : out_.notes) out += fmt::format("# {}\n", printable(note));
    return out;
  }

  std::string gravity() const {
    if (!robot_.gravity) return "gravity: none   # URDF has none; on the ground {uniform: [0, 0, -9.81]}\n";
    return is_zero(*robot_.gravity) ? "gravity: none\n" : fmt::format("gravity: {{uniform: {}}}\n", list_of(*robot_.gravity));
  }

  void name_everything() {
    Names names({"world"});
    for (const RobotBody& body : a_.bodies) names_.push_back(names.take(body.link->name, "body"));
    Names loops({"world"});
    for (const RobotClosure& c : robot_.closures) loop_names_.push_back(loops.take(c.name.empty() ? c.what : c.name, "loop"));
  }

  // ---- the start ----

  const RobotJoint* joint(int id) const {
    const auto found = a_.coordinates.find(id);
    if (found == a_.coordinates.end()) return nullptr;
    return &a_.bodies[static_cast<std::size_t>(found->second.body)].link->joints[static_cast<std::size_t>(found->second.joint)];
  }

  /// Coordinates that were asked for, and those that couplings make of them.
  void find_starts() {
    std::map<std::string, std::vector<int>, std::less<>> ids;
    for (const auto& [id, at] : a_.coordinates)
      if (const RobotJoint* j = joint(id); !j->name.empty() && (j->kind == Kind::hinge || j->kind == Kind::slide))
        ids[j->name].push_back(id);
    for (const auto& [name, value] : source_.options.initial) {
      const auto found = ids.find(name);
      if (found == ids.end()) {
        std::vector<std::string> legal;
        for (const auto& [known, all] : ids)
          if (legal.size() < 1000) legal.push_back(known);
        refuse(Code::unknown_name, {"--initial"},
               fmt::format("the name of a joint with one coordinate: {}{}",
                           fmt::join(std::span(legal).first(std::min<std::size_t>(20, legal.size())), ", "),
                           legal.empty()       ? "there is none"
                           : legal.size() > 20 ? ", ..."
                                               : ""),
               in_quotes(name), did_you_mean(name, legal));
      }
      for (const int id : found->second) {
        const bool slides = joint(id)->kind == Kind::slide;
        const auto number = parse_quantity(value, slides ? "m" : "rad");
        if (!std::holds_alternative<double>(number))
          refuse(Code::command_line, {"--initial"}, fmt::format("{} of joint {}", slides ? "a length" : "an angle", in_quotes(name)),
                 in_quotes(value));
        start_[id] = std::get<double>(number);
      }
    }
    std::map<int, std::size_t> dependent;  // id: its coupling
    for (std::size_t i = 0; i < robot_.closures.size(); ++i) {
      const RobotClosure& c = robot_.closures[i];
      if (c.dependent >= 0 && joint(c.dependent)) dependent.emplace(c.dependent, i);
    }
    std::set<int> open;  // being looked at
    for (const auto& [id, coupling] : dependent) {
      std::vector<int> todo{id};
      while (!todo.empty()) {
        const int now = todo.back();
        const auto found = dependent.find(now);
        if (found == dependent.end() || start_.contains(now)) {
          open.erase(now);
          todo.pop_back();
          continue;
        }
        open.insert(now);
        const RobotClosure& c = robot_.closures[found->second];
        double own = 0.0, rest = c.offset;
        const std::size_t before = todo.size();
        const auto start_of = [&](int other) -> std::optional<double> {  // none: it follows another
          if (!start_.contains(other) && dependent.contains(other)) return todo.push_back(other), std::nullopt;
          const auto at = start_.find(other);
          return at == start_.end() ? 0.0 : at->second;
        };
        for (const auto& [other, coefficient] : c.terms) {
          if (other == now)
            own = coefficient;
          else if (const auto x = start_of(other))
            rest -= coefficient * *x;
        }
        if (!c.polynomial.empty())
          if (const auto x = start_of(c.of))
            for (std::size_t i = 0; i < c.polynomial.size(); ++i) rest += c.polynomial[i] * std::pow(*x, static_cast<double>(i));
        for (std::size_t i = before; i < todo.size(); ++i)
          if (open.contains(todo[i]))
            return source_.report_at(Code::cycle, {called(c.what, c.name), c.mark}, "joints that follow others",
                                     "joints that follow each other");
        if (todo.size() > before) continue;
        start_[now] = own != 0.0 ? rest / own : 0.0;
        open.erase(now);
        todo.pop_back();
      }
    }
  }

  // ---- bodies ----

  std::string body_text(std::size_t i) {
    const RobotBody& body = a_.bodies[i];
    const RobotLink& link = *body.link;
    const RobotInertial& inertial = *link.inertial;
    const std::string& name = names_[i];
    const std::string path = "bodies." + name;
    out_.marks[path] = link.mark;
    out_.marks[path + ".mass"] = inertial.mass_mark;
    out_.marks[path + ".com"] = out_.marks[path + ".inertia"] = inertial.inertia_mark;
    std::string out = fmt::format("  {}:   # {} {}, {}\n", name, link.what, in_quotes(link.name), from(link.mark));
    out += fmt::format("    mass: {}{}\n", inertial.mass, inertial.from.empty() ? "" : "   # of " + inertial.from);
    if (!is_zero(inertial.com)) out += fmt::format("    com: {}\n", list_of(inertial.com));
    const Sym3<double>& J = inertial.J;
    if (J.xy == 0 && J.xz == 0 && J.yz == 0)
      out += fmt::format("    inertia: {}\n", list_of({J.xx, J.yy, J.zz}));
    else
      out += fmt::format("    inertia: {{xx: {}, yy: {}, zz: {}, xy: {}, xz: {}, yz: {}}}\n", J.xx, J.yy, J.zz, J.xy + 0.0, J.xz + 0.0,
                         J.yz + 0.0);
    if (!body.nodes.empty()) {
      out += "    nodes:\n";
      Names names({"world"});
      for (const RobotSite& node : body.nodes) {
        const std::string own = names.take(node.name, "node"), place = place_of(node.place);
        out_.marks[path + ".nodes." + own] = node.mark;
        out += fmt::format("      {}: {{{}}}   # {} {}, {}\n", own, place.empty() ? "position: [0, 0, 0]" : place, node.what,
                           in_quotes(node.name), from(node.mark));
      }
    }
    return out + hinge_text(i, path + ".hinge");
  }

  std::string hinge_text(std::size_t i, const std::string& path) {
    const RobotBody& body = a_.bodies[i];
    const RobotHinge& hinge = body.hinge;
    const std::vector<RobotJoint>& all = body.link->joints;
    const bool free = hinge.type == "free" && hinge.inboard < 0;
    std::string comment, initial, springs, loads, remarks;
    for (std::size_t k = 0; k < all.size(); ++k) {
      const RobotJoint& j = all[k];
      if (!out_.marks.contains(path)) out_.marks[path] = out_.marks[path + ".axis"] = out_.marks[path + ".axes"] = j.axis_mark;
      if (j.name.empty() && j.mark.line == body.link->mark.line) continue;  // the base, which no joint of the file makes free
      comment += fmt::format("{}{}, {}", comment.empty() ? "   # " : "; ", called("joint", j.name), from(j.mark));
      if (!j.remark.empty()) remarks += fmt::format("      # {}: {}\n", called("joint", j.name), printable(j.remark));
    }
    std::string out = fmt::format("    hinge:{}\n      type: {}\n", comment, hinge.type);
    const std::string to = hinge.inboard < 0 ? "world" : names_[static_cast<std::size_t>(hinge.inboard)];
    const std::string place = free ? "" : place_of(hinge.to), at = place_of(hinge.at);
    out += place.empty() ? fmt::format("      to: {}\n", to) : fmt::format("      to: {{body: {}, {}}}\n", to, place);
    if (!at.empty()) out += fmt::format("      at: {{{}}}\n", at);
    if (!hinge.parameters.empty()) out += fmt::format("      {}\n", hinge.parameters);
    if (free && !place_of(hinge.to).empty()) initial = place_of(hinge.to);
    for (std::size_t k = 0; k < all.size() && k < hinge.coordinates.size(); ++k) {
      const RobotJoint& j = all[k];
      const std::string& q = hinge.coordinates[k];
      if (const auto start = start_.find(j.id); start != start_.end() && !q.empty() && start->second != 0.0)
        initial += fmt::format("{}{}: {}", initial.empty() ? "" : ", ", q, start->second);
      springs += springs_of(j, q);
      loads += loads_of(j, q, remarks);
    }
    if (!initial.empty()) out += fmt::format("      initial: {{{}}}\n", initial);
    if (!springs.empty()) out += "      springs:\n" + springs;
    if (!loads.empty()) out += "      loads:\n" + loads;
    return out + remarks;
  }

  static std::string springs_of(const RobotJoint& j, const std::string& q) {
    if (j.stiffness == 0.0 && j.damping == 0.0) return {};
    std::vector<std::string> components{q};
    if (q.empty() && j.kind != Kind::planar) components = {"wx", "wy", "wz"};
    if (j.kind == Kind::free) components.insert(components.end(), {"vx", "vy", "vz"});
    std::string out;
    for (const std::string& component : components) {
      out += fmt::format("        - {{component: {}, stiffness: {}", component, j.stiffness);
      if (j.rest != 0.0) out += fmt::format(", rest: {}", j.rest);
      out += fmt::format(", damping: {}}}\n", j.damping);
    }
    return out;
  }

  std::string loads_of(const RobotJoint& j, const std::string& q, std::string& remarks) {
    std::string out;
    const ImportOptions& o = source_.options;
    if (j.lower && j.upper && !q.empty()) {
      if (o.stop_stiffness && *j.lower == *j.upper)
        source_.sink.report(Code::out_of_range, {"limits of " + called("joint", j.name), j.mark}, "lower less than upper",
                            fmt::format("{:g} twice", *j.lower),
                            "a joint that cannot move is none: attach its body without it (URDF: type=\"fixed\"); without --stop-stiffness "
                            "limits are comments");
      else if (o.stop_stiffness)
        out += fmt::format("        - {{type: stop, component: {}, lower: {}, upper: {}, stiffness: {}, exponent: 1}}\n", q, *j.lower + 0.0,
                           *j.upper + 0.0, *o.stop_stiffness);
      else
        remarks += fmt::format("      # limits of {}: {} to {} {}\n", called("joint", j.name), *j.lower + 0.0, *j.upper + 0.0,
                               j.kind == Kind::slide ? "m" : "rad");
      ++n_limits_;
    }
    if (j.friction != 0.0 && !q.empty()) {
      if (o.friction_width)
        out += fmt::format("        - {{type: friction, component: {}, coulomb: {}, width: {}}}\n", q, j.friction, *o.friction_width);
      else
        remarks +=
            fmt::format("      # dry friction of {}: {} {}\n", called("joint", j.name), j.friction, j.kind == Kind::slide ? "N" : "N m");
      ++n_frictions_;
    }
    return out;
  }

  // ---- loops ----

  std::string end_text(const RobotClosure::End& end) const {
    const Carrier carrier = end.link < 0 ? Carrier{} : a_.carriers[static_cast<std::size_t>(end.link)];
    RobotPlace place = end.place;
    if (end.link >= 0 && (!is_zero(carrier.place.X.p) || is_turned(carrier.place.X.R))) place = {carrier.place.X * end.place.X, {}};
    const std::string body = carrier.body < 0 ? "world" : names_[static_cast<std::size_t>(carrier.body)], text = place_of(place);
    return text.empty() ? body : fmt::format("{{body: {}, {}}}", body, text);
  }

  std::string loop_text(std::size_t i) {
    const RobotClosure& c = robot_.closures[i];
    out_.marks["loops." + loop_names_[i]] = c.mark;
    std::string out = fmt::format("  {}:   # {}, {}\n    type: {}\n", loop_names_[i], called(c.what, c.name), from(c.mark), c.type);
    const auto coordinate = [&](int id) -> std::string {
      const auto found = a_.coordinates.find(id);
      if (found == a_.coordinates.end()) {
        source_.report_at(Code::not_imported, {called(c.what, c.name), c.mark}, "joints of bodies that are there",
                          "a joint that was left out");
        return {};
      }
      const std::string& own = names_[static_cast<std::size_t>(found->second.body)];
      const auto& all = a_.bodies[static_cast<std::size_t>(found->second.body)].hinge.coordinates;
      const auto k = static_cast<std::size_t>(found->second.joint);
      return own + (all.size() > 1 && k < all.size() ? "." + all[k] : "");
    };
    if (c.type != "coupling") {
      if (c.axis) out += fmt::format("    axis: {}\n", list_of(*c.axis));
      return out + fmt::format("    from: {}\n    to: {}\n", end_text(c.from), end_text(c.to));
    }
    out += "    terms: {";
    bool first = true;
    for (const auto& [id, coefficient] : c.terms) {
      const std::string name = coordinate(id);
      if (name.empty()) continue;
      out += fmt::format("{}{}: {}", first ? "" : ", ", name, coefficient);
      first = false;
    }
    out += "}\n";
    if (!c.polynomial.empty())
      out +=
          fmt::format("    functions: [{{of: {{{}: 1}}, scale: -1, polynomial: [{}]}}]\n", coordinate(c.of), fmt::join(c.polynomial, ", "));
    return out + (c.offset == 0.0 ? "" : fmt::format("    offset: {}\n", c.offset));
  }

  const Robot& robot_;
  const Assembled& a_;
  RobotSource& source_;
  Imported out_;
  std::vector<std::string> names_, loop_names_;
  std::map<int, double> start_;  // coordinates by the ids of joints
  int n_limits_ = 0, n_frictions_ = 0;
};

}  // namespace

Diagnostic Imported::at_its_source(Diagnostic d) const {
  std::string_view around = d.at.key_path;
  while (true) {
    if (const auto found = marks.find(std::string(around)); found != marks.end()) {
      d.at.mark = found->second;
      d.span = 1;
      break;
    }
    const auto cut = around.find_last_of(".[");
    if (cut == around.npos) break;
    around = around.substr(0, cut);
  }
  if (d.code == Code::non_positive_mass) d.hint = "a rotor has a mass, too: a small one changes little";
  if (d.code == Code::open_start) d.hint = "--initial JOINT=VALUE begins elsewhere";
  return d;
}

Imported import_robot(std::string_view text, const std::string& file, const ImportOptions& options) {
  const auto root = parse_xml(text, file);
  RobotSource source(file, options);
  if (root->name != "robot" && root->name != "mujoco")
    source.report(Code::not_imported, *root, {}, "a robot (URDF) or mujoco (MJCF)", in_quotes(root->name),
                  root->name == "sdf" ? "convert it to URDF" : "");
  source.sink.throw_if_any();
  Robot robot = root->name == "robot" ? read_urdf(*root, source) : read_mjcf(*root, source);
  source.sink.throw_if_any();
  const Assembled assembled = assemble(robot, source);
  return VehicleText(robot, assembled, source).write();
}

}  // namespace cardan
