// XYZ, TXT and CSV: one point a line. A header line may name the columns; without one, three columns are x y
// z and six are x y z nx ny nz. Of any other number only the first three count, for nothing says what the
// rest are.
#include <array>
#include <cstring>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/mover.hpp"

namespace bitr::io {
namespace {

// Cells are separated by blanks, or by one comma or semicolon with blanks around it.
class Cells {
 public:
  explicit Cells(std::string_view line) : at_(line.data()), end_(line.data() + line.size()) { skip_blanks(); }

  /// False at the end of the line. A cell may be empty, between two commas.
  bool next(std::string_view& cell) {
    if (at_ == end_) return false;
    const char* begin = at_;
    while (at_ != end_ && !is_blank(*at_) && !is_separator(*at_)) ++at_;
    cell = {begin, static_cast<std::size_t>(at_ - begin)};
    skip_blanks();
    if (at_ != end_ && is_separator(*at_)) {
      ++at_;
      skip_blanks();
    }
    return true;
  }

 private:
  static bool is_separator(char c) { return c == ',' || c == ';'; }
  void skip_blanks() {
    while (at_ != end_ && is_blank(*at_)) ++at_;
  }
  const char *at_, *end_;
};

std::string_view without_comment(std::string_view line) {
  const auto* hash = static_cast<const char*>(std::memchr(line.data(), '#', line.size()));
  if (hash) line = line.substr(0, static_cast<std::size_t>(hash - line.data()));
  const auto* slash = static_cast<const char*>(std::memchr(line.data(), '/', line.size()));
  if (slash && slash + 1 < line.data() + line.size() && slash[1] == '/')
    line = line.substr(0, static_cast<std::size_t>(slash - line.data()));
  return line;
}

struct Columns {
  std::vector<int> roles;
  bool normals = false, colors = false;
  NormalColumns normal_columns = NormalColumns::named;
};

std::string_view unquoted(std::string_view cell) {
  const bool quoted = cell.size() >= 2 && cell.front() == '"' && cell.back() == '"';
  return quoted ? cell.substr(1, cell.size() - 2) : cell;
}

Result<Columns> named_columns(const File& file, Place place, std::string_view line) {
  Columns columns;
  Roles roles;
  Cells cells(line);
  std::string_view cell;
  while (cells.next(cell)) {
    columns.roles.push_back(role_of(unquoted(cell)));
    if (!roles.add(columns.roles.back())) return bad(file, place, "two columns are named ", in_quotes(cell));
  }
  if (!roles.positions()) {
    return bad(file, place, in_quotes(line), " is neither numbers nor column names with x, y and z");
  }
  columns.normals = roles.normals();
  columns.colors = roles.colors();
  for (int& role : columns.roles) {
    if (role >= role_red ? !columns.colors : role >= role_nx && !columns.normals) role = no_role;
  }
  return columns;
}

Result<Columns> assumed_columns(const File& file, Place place, std::string_view line) {
  Columns columns;
  Cells cells(line);
  std::string_view cell;
  while (cells.next(cell)) columns.roles.push_back(no_role);
  const std::size_t count = columns.roles.size();
  if (count < 3) return bad(file, place, count, " columns; x, y and z need 3");
  columns.normals = count == 6;
  columns.normal_columns = NormalColumns::assumed;
  for (int i = 0; i < (columns.normals ? 6 : 3); ++i) columns.roles[i] = i;
  return columns;
}

Result<void> read_row(const File& file, Place place, const Columns& columns, std::string_view line,
                      CloudBuilder& builder) {
  Row row{};
  Cells cells(line);
  std::string_view cell;
  std::size_t column = 0;
  while (cells.next(cell)) {
    const int role = column < columns.roles.size() ? columns.roles[column] : no_role;
    ++column;
    if (role != no_role && !parse_number(cell, row[role]))
      return bad(file, place, "column ", column, " is ", in_quotes(cell), ", not a finite number");
    if (file.mover && role != no_role) file.mover->word(role, cell, row[role]);
  }
  if (column != columns.roles.size())
    return bad(file, place, column, " columns; the first line has ", columns.roles.size());
  return builder.add(row, place);
}

}  // namespace

Result<Geometry> parse_text(const File& file) {
  std::string_view text = file.text();
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  Lines lines(text);
  std::string_view line, cell;
  do {
    if (!lines.next_filled(line)) return refuse(ErrorCode::bad_file, file, "no points");
    line = without_comment(line);
  } while (!Cells(line).next(cell));

  double number = 0;
  const bool header = !cell.empty() && !parse_number(cell, number);
  const Place first = Place::line(lines.number());
  const auto columns = header ? named_columns(file, first, line) : assumed_columns(file, first, line);
  if (!columns) return tl::unexpected(columns.error());
  CloudBuilder builder(file, columns->normals, columns->colors, columns->normal_columns);
  if (!header) {
    if (auto read = read_row(file, first, *columns, line, builder); !read)
      return tl::unexpected(read.error());
  }
  while (lines.next_filled(line)) {
    line = without_comment(line);
    if (!Cells(line).next(cell)) continue;
    const Place place = Place::line(lines.number());
    if (auto read = read_row(file, place, *columns, line, builder); !read)
      return tl::unexpected(read.error());
  }
  return builder.finish();
}

}  // namespace bitr::io
