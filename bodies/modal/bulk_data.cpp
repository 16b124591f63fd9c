// Solid elements in the bulk data of NASTRAN: fields free, of 8 and of 16 characters.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "bodies/modal/solids.hpp"
#include "bodies/modal/text_lines.hpp"

namespace cardan {
namespace {

constexpr double kTwoOfThree = 1e-2;  // relative: E = 2 G (1 + nu) where all three are given

/// Cards that say nothing of mass and stiffness of solids: conditions and loads of an analysis, its output, coordinate systems and
/// properties that no solid element refers to. What holds, joins or adds mass otherwise is not here: it is refused.
constexpr std::array kNotOfTheBody = {
    "SPC",   "SPC1",   "SPCADD", "SPCD",   "SUPORT", "SUPORT1", "ASET",    "ASET1",   "BSET",    "BSET1", "CSET",   "CSET1",  "QSET",
    "QSET1", "USET",   "USET1",  "FORCE",  "FORCE1", "FORCE2",  "MOMENT",  "MOMENT1", "MOMENT2", "PLOAD", "PLOAD1", "PLOAD2", "PLOAD4",
    "GRAV",  "RFORCE", "LOAD",   "DLOAD",  "RLOAD1", "RLOAD2",  "TLOAD1",  "TLOAD2",  "DAREA",   "TEMP",  "TEMPD",  "EIGR",   "EIGRL",
    "EIGB",  "EIGC",   "FREQ",   "FREQ1",  "FREQ2",  "TSTEP",   "TABLED1", "TABDMP1", "TABLEM1", "MATT1", "SET1",   "SET3",   "PLOTEL",
    "PARAM", "CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C",  "CORD2S",  "PSHELL",  "PCOMP",   "PBAR",  "PBARL",  "PBEAM",  "PBEAML",
    "PROD",  "PBUSH",  "PELAS",  "MAT2",   "MAT8",   "MAT9",    "MAT10",   "MAT11"};

std::string trimmed(std::string text) {
  const auto first = text.find_first_not_of(" \t"), last = text.find_last_not_of(" \t");
  return first == std::string::npos ? std::string() : text.substr(first, last - first + 1);
}

struct Card {
  std::string name;
  std::vector<std::string> fields;  // those behind the name
  int line = 0;
};

class BulkData {
 public:
  BulkData(const std::string& path, SolidModel::Units units, const Located& at)
      : path_(path),
        at_(at),
        length_(units == SolidModel::Units::si ? 1.0 : 1e-3),
        stress_(units == SolidModel::Units::si ? 1.0 : 1e6),
        density_(units == SolidModel::Units::si ? 1.0 : 1e12) {}

  SolidMesh read() {
    read_cards();
    mesh_.file = path_;
    std::map<std::string, int> passed;
    for (const Card& card : cards_) {
      if (card.name == "GRID")
        grid(card);
      else if (card.name == "CTETRA" || card.name == "CHEXA" || card.name == "CPENTA")
        elements_.push_back(&card);
      else if (card.name == "PSOLID")
        solid(card);
      else if (card.name == "MAT1")
        material(card);
      else if (std::ranges::find(kNotOfTheBody, card.name) != kNotOfTheBody.end()) {
        if (card.name.starts_with("CORD")) system(card);
        ++passed[pass_over(card)];
      } else
        refuse(card, "GRID, CTETRA, CHEXA, CPENTA, PSOLID and MAT1", card.name, other_card(card.name), Code::unsupported);
    }
    for (const Card* card : elements_) element(*card);
    for (const auto& [system, card] : turned_)
      if (!systems_.contains(system))
        refuse(*card, "GRID whose displacements are in a system of the file", fmt::format("system {}", system),
               "a coordinate that is longer than its field goes on in the next one");
    for (const auto& [id, elements] : weightless_) mesh_.weightless.push_back(fmt::format("MAT1 {} ({})", id, elements));
    for (const auto& [name, times] : passed) mesh_.passed_over.push_back(times == 1 ? name : fmt::format("{} ({})", name, times));
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void refuse(int line, std::string expected, std::string got, std::string hint = {}, Code code = Code::bad_modal_data) const {
    cardan::refuse(code, {at_.key_path, {path_, line, 0}}, std::move(expected), std::move(got), std::move(hint));
  }
  [[noreturn]] void refuse(const Card& card, std::string expected, std::string got, std::string hint = {},
                           Code code = Code::bad_modal_data) const {
    refuse(card.line, std::move(expected), std::move(got), std::move(hint), code);
  }

  static std::string other_card(const std::string& name) {
    if (name == "CONM1" || name == "CONM2") return "a lumped mass is one of `masses`";
    if (name.starts_with("RBE") || name == "RBAR" || name == "MPC" || name == "MPCADD")
      return "what moves rigidly, or with the mean of some nodes, is one of `nodes` with `numbers`";
    if (name.starts_with("SOL") || name == "CEND") return "what stands before the bulk data ends with a line BEGIN BULK";
    if (name.starts_with('C')) return "a body of solids has no other elements; matrices of the whole go by `matrices`";
    return "it might change mass, stiffness or places; take it out if it does not";
  }

  void read_cards() {
    TextLines lines(path_, at_, "bulk data of NASTRAN: GRID, CTETRA, CHEXA, CPENTA, PSOLID, MAT1");
    std::vector<std::pair<int, std::string>> text;
    bool begun = false;
    for (int number = 1; lines.next(); ++number) {
      std::string line;
      for (const char c : lines.line()) {
        if (c == '$') break;
        if (c == '\t')
          line.append(8 - line.size() % 8, ' ');
        else
          line += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
      }
      if (trimmed(line).empty()) continue;
      if (trimmed(line).starts_with("BEGIN") && (begun || line.find("BULK") != std::string::npos)) {
        if (begun) refuse(number, "one section of bulk data", trimmed(line), "superelements are bodies of their own", Code::unsupported);
        // What stood above says what to compute, but for parameters, which may stand there too.
        std::erase_if(
            text, [](const auto& above) { return !trimmed(above.second).starts_with("PARAM,") && !above.second.starts_with("PARAM "); });
        begun = true;
      } else if (trimmed(line) == "ENDDATA")
        break;
      else
        text.emplace_back(number, std::move(line));
    }
    std::string mark;  // of the line before: what its continuation begins with
    for (const auto& [number, line] : text) {
      if (trimmed(line).starts_with("INCLUDE"))
        refuse(number, "all of the mesh in one file", trimmed(line), "put its text in place of the line", Code::unsupported);
      std::vector<std::string> fields = line.find(',') != std::string::npos ? free_fields(number, line) : fixed_fields(line);
      const std::string name = fields.front(), end = fields.back();
      fields.erase(fields.begin()), fields.pop_back();
      if (name.empty() || name[0] == '+' || name[0] == '*') {
        if (cards_.empty()) refuse(number, "a card for the line to continue", trimmed(line));
        // A mark begins with + or *, or as it likes where the line that follows repeats the rest of it.
        const bool bare = mark.empty() || mark[0] == '+' || mark[0] == '*';
        if (!bare && (mark.size() == 1 || name.empty() || name.substr(1) != mark.substr(1)))
          refuse(number, fmt::format("the continuation {} of the line above", mark), name.empty() ? "no name" : name,
                 fmt::format("where a number of the line above is longer than its field, {} is the end of it", mark));
        if (name.size() > 1 && mark.size() > 1 && name.substr(1) != mark.substr(1))
          refuse(number, fmt::format("the continuation {} of the line above", mark), name, "each card with its continuations behind it");
        cards_.back().fields.insert(cards_.back().fields.end(), fields.begin(), fields.end());
      } else {
        cards_.push_back({name.ends_with('*') ? name.substr(0, name.size() - 1) : name, std::move(fields), number});
      }
      mark = end;
    }
  }

  /// Name, fields, mark of continuation.
  std::vector<std::string> free_fields(int number, const std::string& line) const {
    std::vector<std::string> out(1);
    for (const char c : line)
      if (c == ',')
        out.emplace_back();
      else
        out.back() += c;
    for (std::string& field : out) field = trimmed(field);
    const std::size_t most = out[0].find('*') != std::string::npos ? 5 : 9;
    if (out.size() > most + 1) refuse(number, fmt::format("at most {} fields in a line", most - 1), fmt::format("{}", out.size() - 1));
    std::string end = out.size() > most ? out[most] : "";
    out.resize(most);
    out.push_back(std::move(end));
    return out;
  }
  static std::vector<std::string> fixed_fields(const std::string& line) {
    const auto part = [&](std::size_t from, std::size_t count) {
      return from < line.size() ? trimmed(line.substr(from, count)) : std::string();
    };
    std::vector<std::string> out = {part(0, 8)};
    const std::size_t width = out[0].find('*') != std::string::npos ? 16 : 8;
    for (std::size_t from = 8; from < 72; from += width) out.push_back(part(from, width));
    out.push_back(part(72, 8));
    return out;
  }

  static std::string text(const Card& card, std::size_t i) { return i < card.fields.size() ? card.fields[i] : std::string(); }
  void only(const Card& card, std::size_t count) const {
    for (std::size_t i = count; i < card.fields.size(); ++i)
      if (!card.fields[i].empty())
        refuse(card, fmt::format("{} with at most {} fields", card.name, count), fmt::format("{} in field {}", card.fields[i], i + 1));
  }

  int integer(const Card& card, std::size_t i, const char* what, int least = 1) const {
    const std::string field = text(card, i);
    int value = 0;
    const auto [end, error] = std::from_chars(field.data() + field.starts_with('+'), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size() || value < least)
      refuse(card, fmt::format("{}: {} in field {}", card.name, what, i + 1), field.empty() ? "nothing" : field);
    return value;
  }
  /// 7.0, 7., .7, 7.-1, 7.E-1, 7.D-1.
  double real(const Card& card, std::size_t i, const char* what) const {
    std::string field = text(card, i);
    const std::string given = field;
    std::ranges::replace(field, 'D', 'E');
    if (const auto sign = field.find_last_of("+-"); sign != std::string::npos && sign > 0 && field.find('E') == std::string::npos)
      field.insert(sign, "E");
    if (const auto plus = field.find("E+"); plus != std::string::npos) field.erase(plus + 1, 1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(field.data() + field.starts_with('+'), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(value))
      refuse(card, fmt::format("{}: {} in field {}", card.name, what, i + 1), given.empty() ? "nothing" : given);
    return value;
  }
  double real_or(const Card& card, std::size_t i, const char* what, double fallback) const {
    return text(card, i).empty() ? fallback : real(card, i, what);
  }

  void grid(const Card& card) {
    only(card, 8);
    const int number = integer(card, 0, "the number of a node");
    const auto zero = [&](std::size_t i) { return text(card, i).empty() || text(card, i) == "0"; };
    if (!zero(1))
      refuse(card, "GRID in the basic coordinate system", fmt::format("node {} in system {}", number, text(card, 1)),
             "write the mesh in the basic system", Code::unsupported);
    if (!zero(6) && text(card, 6).find_first_not_of("456") != std::string::npos)
      refuse(card, "GRID without a constraint", fmt::format("node {} with {}", number, text(card, 6)), "what is held is `root`",
             Code::unsupported);
    if (!zero(7)) refuse(card, "GRID of no superelement", text(card, 7), {}, Code::unsupported);
    if (const int turned = zero(5) ? 0 : integer(card, 5, "the system of displacements", -1); turned > 0) turned_.emplace(turned, &card);
    if (!index_.emplace(number, static_cast<int>(mesh_.nodes.size())).second)
      refuse(card, "a node with a number of its own", fmt::format("node {} twice", number));
    Eigen::Vector3d x;
    for (int a = 0; a < 3; ++a) x[a] = length_ * real_or(card, static_cast<std::size_t>(a) + 2, "a coordinate", 0.0);
    mesh_.nodes.push_back(x);
    mesh_.numbers.push_back(number);
    mesh_.lines.push_back(card.line);
  }

  /// One coordinate system, or by three nodes each two of them.
  void system(const Card& card) {
    systems_.insert(integer(card, 0, "the number of a coordinate system"));
    if (card.name.starts_with("CORD1") && !text(card, 4).empty()) systems_.insert(integer(card, 4, "the number of a coordinate system"));
  }

  void element(const Card& card) {
    SolidMesh::Element e{SolidShape::tetra10, integer(card, 0, "the number of an element"), card.line, {}, 0};
    if (!numbers_.insert(e.number).second) refuse(card, "an element with a number of its own", fmt::format("element {} twice", e.number));
    const int property = integer(card, 1, "the number of a PSOLID");
    std::size_t count = card.fields.size();
    while (count > 2 && card.fields[count - 1].empty()) --count;
    count -= std::min<std::size_t>(count, 2);
    const auto expect = [&](std::size_t nodes, const char* hint) {
      if (count != nodes)
        refuse(card, fmt::format("{} with {} nodes", card.name, nodes), fmt::format("element {} with {}", e.number, count), hint,
               Code::unsupported);
    };
    if (card.name == "CTETRA") {
      expect(10, "that of 4 nodes is far too stiff in bending: mesh with elements of second order");
    } else if (card.name == "CPENTA") {
      e.shape = SolidShape::penta15;
      expect(15, "that of 6 nodes is far too stiff in bending: mesh with elements of second order");
    } else {
      e.shape = count == 8 ? SolidShape::hexa8 : SolidShape::hexa20;
      if (count != 8) expect(20, "or 8");
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (text(card, i + 2).empty() || text(card, i + 2) == "0")
        refuse(card, "nodes on all edges", fmt::format("element {} without its node {}", e.number, i + 1),
               "mesh with complete elements of second order", Code::unsupported);
      const auto node = index_.find(integer(card, i + 2, "the number of a node"));
      if (node == index_.end())
        refuse(card, "numbers of GRIDs of the file", fmt::format("node {} of element {}", text(card, i + 2), e.number));
      e.nodes.push_back(node->second);
    }
    const auto to = properties_.find(property);
    if (to == properties_.end()) refuse(card, "the number of a PSOLID of the file", fmt::format("{} of element {}", property, e.number));
    const auto [id, line] = to->second;
    const auto material = materials_.find(id);
    if (material == materials_.end())
      refuse(line, "the number of a MAT1 of the file", fmt::format("material {} of PSOLID {}", id, property), "materials are isotropic");
    e.material = material->second;
    if (mesh_.materials[static_cast<std::size_t>(e.material)].rho == 0.0) ++weightless_[id];
    mesh_.elements.push_back(std::move(e));
  }

  void solid(const Card& card) {
    const int number = integer(card, 0, "the number of a property");
    if (const std::string kind = text(card, 6); !kind.empty() && kind != "SMECH")
      refuse(card, "PSOLID of a structure", kind, "a fluid is no part of a body", Code::unsupported);
    if (!properties_.emplace(number, std::pair(integer(card, 1, "the number of a material"), card.line)).second)
      refuse(card, "a property with a number of its own", fmt::format("PSOLID {} twice", number));
  }

  void material(const Card& card) {
    const int number = integer(card, 0, "the number of a material");
    const double none = NAN, E = real_or(card, 1, "E", none), G = real_or(card, 2, "G", none), nu = real_or(card, 3, "nu", none);
    Material m{E, nu, density_ * real_or(card, 4, "the density rho", 0.0)};
    if (std::isnan(E) + std::isnan(G) + std::isnan(nu) > 1) refuse(card, "MAT1 with two of E, G and nu", "fewer");
    if (std::isnan(E)) m.E = 2.0 * G * (1.0 + nu);
    if (std::isnan(nu)) m.nu = E / (2.0 * G) - 1.0;
    if (!std::isnan(E) && !std::isnan(nu) && !std::isnan(G) && !(std::abs(E / (2.0 * G * (1.0 + nu)) - 1.0) <= kTwoOfThree))
      refuse(card, "E = 2 G (1 + nu): an isotropic material", fmt::format("E = {:g}, G = {:g}, nu = {:g}", E, G, nu),
             "leave one of them out");
    m.E *= stress_;
    if (!(m.E > 0.0 && m.nu > -1.0 && m.nu < 0.5 && m.rho >= 0.0))
      refuse(card, "MAT1 with E > 0, -1 < nu < 0.5, rho >= 0", fmt::format("E = {:g} Pa, nu = {:g}, rho = {:g} kg/m^3", m.E, m.nu, m.rho),
             {}, Code::out_of_range);
    if (!materials_.emplace(number, static_cast<int>(mesh_.materials.size())).second)
      refuse(card, "a material with a number of its own", fmt::format("MAT1 {} twice", number));
    mesh_.materials.push_back(m);
    if (!text(card, 7).empty()) mesh_.passed_over.push_back(fmt::format("GE of MAT1 {}", number));
  }

  std::string pass_over(const Card& card) const {
    if (card.name == "PARAM" && text(card, 0) == "WTMASS" && real(card, 1, "a number") != 1.0)
      refuse(card, "densities as they are", fmt::format("PARAM,WTMASS,{}", text(card, 1)),
             "write densities with their masses, and leave the line out", Code::unsupported);
    return card.name == "PARAM" ? "PARAM " + text(card, 0) : card.name;
  }

  std::string path_;
  Located at_;
  double length_, stress_, density_;
  SolidMesh mesh_;
  std::vector<Card> cards_;
  std::vector<const Card*> elements_;
  std::set<int> numbers_, systems_;
  std::map<int, const Card*> turned_;              // systems of displacements -> the first node in it
  std::map<int, int> index_, materials_;           // number -> index
  std::map<int, int> weightless_;                  // number of a material without density -> how many elements
  std::map<int, std::pair<int, int>> properties_;  // number -> material, line
};

}  // namespace

SolidMesh read_bulk_data(const std::string& path, SolidModel::Units units, const Located& at) { return BulkData(path, units, at).read(); }

}  // namespace cardan
