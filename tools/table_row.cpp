#include "table_row.hpp"

namespace bitr::tool {
namespace {

constexpr std::string_view blanks = " \t\r";

class Row {
 public:
  explicit Row(std::string_view line) : rest_(line) {}

  Result<std::vector<std::string>> fields() {
    std::vector<std::string> all;
    for (;;) {
      skip_blanks();
      auto field = rest_.starts_with('"') ? quoted() : plain();
      if (!field) return tl::unexpected(field.error());
      all.push_back(std::move(*field));
      if (rest_.empty()) return all;
      rest_.remove_prefix(1);  // the comma
    }
  }

 private:
  void skip_blanks() {
    const std::size_t filled = rest_.find_first_not_of(blanks);
    rest_.remove_prefix(filled == std::string_view::npos ? rest_.size() : filled);
  }

  Result<std::string> plain() {
    const std::string_view field = rest_.substr(0, rest_.find(','));
    rest_.remove_prefix(field.size());
    return std::string(field.substr(0, field.find_last_not_of(blanks) + 1));
  }

  Result<std::string> quoted() {
    std::string field;
    do {
      rest_.remove_prefix(1);
      const std::size_t end = rest_.find('"');
      if (end == std::string_view::npos) return fail(ErrorCode::bad_file, "a quote is not closed");
      field += rest_.substr(0, end);
      rest_.remove_prefix(end + 1);
      if (rest_.starts_with('"')) field += '"';
    } while (rest_.starts_with('"'));
    skip_blanks();
    if (!rest_.empty() && rest_.front() != ',')
      return fail(ErrorCode::bad_file, "something stands between a closed quote and the next comma");
    return field;
  }

  std::string_view rest_;
};

}  // namespace

Result<std::vector<std::string>> table_row(std::string_view line) { return Row(line).fields(); }

}  // namespace bitr::tool
