// A line of a CSV table, taken apart.
#pragma once

#include <bitr/result.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace bitr::tool {

/// Its fields, without the blanks around them. A field in double quotes may hold commas, and quotes that are
/// doubled. `bad_file`, without file and line, when a quote is not closed or something follows it.
Result<std::vector<std::string>> table_row(std::string_view line);

}  // namespace bitr::tool
