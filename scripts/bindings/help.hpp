#pragma once
#include "scripts/lua/reference.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// What the program knows of its own scenario API.
const ApiReference& api_reference();

/// Makes the global `help`: as a value an overview; help(x) about an object or a function, help "name" about a name.
void bind_help(Scenario&);

/// Names that complete a text in quotes behind `word`, the name before the quote: of bodies behind `hinge`, of nodes behind `node`,
/// of topics behind `help`, else all of bodies, nodes and components.
std::vector<std::string> names_for(const Scenario&, std::string_view word);

}  // namespace cardan
