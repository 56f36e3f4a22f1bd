// NPY 1.0 to 3.0: a Python dictionary that describes the array, then its raw values.
#include <optional>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/mover.hpp"
#include "io/scalar.hpp"

namespace bitr::io {
namespace {

struct Header {
  std::optional<std::string_view> type, order, shape;  ///< as spelled in the dictionary, quotes removed
};

// Reads { 'key': value, … } where a value is a quoted string, a bare word, or anything in balanced brackets.
class Dictionary {
 public:
  explicit Dictionary(std::string_view text) : text_(text) {}

  bool parse(Header& header) {
    if (!take('{')) return false;
    while (!take('}')) {
      std::string_view key, value;
      if (!quoted(key) || !take(':') || !any(value)) return false;
      std::optional<std::string_view>* slot = key == "descr"           ? &header.type
                                              : key == "fortran_order" ? &header.order
                                              : key == "shape"         ? &header.shape
                                                                       : nullptr;
      if (!slot || *slot) return false;
      *slot = value;
      if (take(',')) continue;
      if (!take('}')) return false;
      break;
    }
    skip_blanks();
    return at_ == text_.size() && header.type && header.order && header.shape;
  }

 private:
  void skip_blanks() {
    while (at_ < text_.size() && (is_blank(text_[at_]) || text_[at_] == '\n')) ++at_;
  }
  bool take(char c) {
    skip_blanks();
    if (at_ == text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  bool quoted(std::string_view& out) {
    skip_blanks();
    if (at_ == text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) return false;
    const std::size_t end = text_.find(text_[at_], at_ + 1);
    if (end == std::string_view::npos) return false;
    out = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return true;
  }
  bool any(std::string_view& out) {
    if (quoted(out)) return true;
    const std::size_t begin = at_;
    int depth = 0;
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (c == '(' || c == '[') ++depth;
      if (depth == 0 && (c == ',' || c == '}')) break;
      if ((c == ')' || c == ']') && --depth < 0) return false;
    }
    out = text_.substr(begin, at_ - begin);
    while (!out.empty() && is_blank(out.back())) out.remove_suffix(1);
    return !out.empty() && depth == 0;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

// "(rows, columns)" and nothing else.
bool parse_shape(std::string_view text, std::uint64_t& rows, std::uint64_t& columns) {
  if (text.size() < 5 || text.front() != '(' || text.back() != ')') return false;
  text = text.substr(1, text.size() - 2);
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos) return false;
  Words first(text.substr(0, comma));
  std::string_view rest = text.substr(comma + 1);
  while (!rest.empty() && is_blank(rest.back())) rest.remove_suffix(1);
  if (rest.ends_with(',')) rest.remove_suffix(1);
  Words second(rest);
  return parse_integer(first.next(), rows) && first.next().empty() && parse_integer(second.next(), columns) &&
         second.next().empty();
}

}  // namespace

Result<Geometry> parse_npy(const File& file) {
  const auto& bytes = file.bytes;
  if (!file.text().starts_with("\x93NUMPY"))
    return bad(file, Place::byte(0), "not an NPY file: ", in_quotes(file.text().substr(0, 6)));
  if (bytes.size() < 10) return bad(file, Place::byte(bytes.size()), "the file ends within the NPY header");
  const int major = std::to_integer<int>(bytes[6]);
  if (major < 1 || major > 3)
    return bad(file, Place::byte(6), "NPY version ", major, "; versions 1 to 3 are read");
  const std::size_t start = major == 1 ? 10 : 12;
  if (bytes.size() < start) return bad(file, Place::byte(8), "the file ends within the NPY header");
  const std::size_t length = major == 1 ? load<std::uint16_t>(&bytes[8]) : load<std::uint32_t>(&bytes[8]);
  if (length > bytes.size() - start)
    return bad(file, Place::byte(8), "a header of ", length, " bytes, ", bytes.size() - start, " remain");

  const std::string_view dictionary = file.text().substr(start, length);
  Header header;
  if (!Dictionary(dictionary).parse(header)) {
    return bad(file, Place::byte(start), in_quotes(dictionary),
               " is not a dictionary of descr, fortran_order and shape");
  }
  if (header.type != "<f4" && header.type != "<f8") {
    return refuse(ErrorCode::unsupported, file, "descr ", in_quotes(*header.type),
                  "; only '<f4' and '<f8' (little-endian floats) are read");
  }
  if (header.order != "False") {
    return refuse(ErrorCode::unsupported, file, "fortran_order ", in_quotes(*header.order),
                  "; only C order (False) is read");
  }
  std::uint64_t rows = 0, columns = 0;
  if (!parse_shape(*header.shape, rows, columns) || (columns != 3 && columns != 6)) {
    return refuse(ErrorCode::bad_file, file, "shape ", in_quotes(*header.shape),
                  "; a cloud is (N, 3), or (N, 6) with normals");
  }
  const ScalarType type = header.type == "<f4" ? ScalarType::f32 : ScalarType::f64;
  const std::size_t body = start + length, remaining = bytes.size() - body;
  const std::uint64_t row_bytes = columns * size_of(type);
  if (rows > remaining / row_bytes || rows * row_bytes != remaining) {
    return bad(file, Place::byte(body), rows, " rows of ", columns, " need ", product(rows, row_bytes),
               " bytes, ", remaining, " remain");
  }
  CloudBuilder builder(file, columns == 6, false, NormalColumns::assumed);
  builder.reserve(rows);
  for (std::uint64_t i = 0; i < rows; ++i) {
    const std::size_t at = body + i * row_bytes;
    Row row{};
    for (std::size_t k = 0; k < columns; ++k) {
      const std::byte* value = &bytes[at + k * size_of(type)];
      row[k] = load_as<double>(type, value);
      if (file.mover) file.mover->number(static_cast<int>(k), type, value);
    }
    if (auto added = builder.add(row, Place::byte(at)); !added) return tl::unexpected(added.error());
  }
  return builder.finish();
}

}  // namespace bitr::io
