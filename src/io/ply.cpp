// PLY: a text header that declares elements and their properties, then rows in text or binary.
#include <algorithm>
#include <limits>
#include <optional>
#include <string>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/mover.hpp"
#include "io/scalar.hpp"

namespace bitr::io {
namespace {

enum class Encoding { ascii, little, big };

struct Property {
  std::string_view name;
  ScalarType type = ScalarType::f32;
  std::optional<ScalarType> length;  ///< type of a list's item count
  int role = no_role;
};

struct Element {
  std::string_view name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
  int corners = -1;  ///< which property lists a face's vertices
};

struct Header {
  Encoding encoding = Encoding::ascii;
  std::vector<Element> elements;
  std::size_t lines = 0, bytes = 0;
};

std::optional<ScalarType> scalar_type(std::string_view word) {
  static constexpr struct {
    std::string_view name;
    ScalarType type;
  } names[] = {{"char", ScalarType::i8},    {"int8", ScalarType::i8},     {"uchar", ScalarType::u8},
               {"uint8", ScalarType::u8},   {"short", ScalarType::i16},   {"int16", ScalarType::i16},
               {"ushort", ScalarType::u16}, {"uint16", ScalarType::u16},  {"int", ScalarType::i32},
               {"int32", ScalarType::i32},  {"uint", ScalarType::u32},    {"uint32", ScalarType::u32},
               {"float", ScalarType::f32},  {"float32", ScalarType::f32}, {"double", ScalarType::f64},
               {"float64", ScalarType::f64}};
  for (const auto& [name, type] : names) {
    if (name == word) return type;
  }
  return std::nullopt;
}

Result<Property> parse_property(const File& file, Place place, Words words) {
  Property property;
  std::string_view type = words.next();
  if (type == "list") {
    const std::string_view length = words.next();
    property.length = scalar_type(length);
    if (!property.length || is_float(*property.length))
      return bad(file, place, in_quotes(length), " is not an integer type for a list's length");
    type = words.next();
  }
  const auto scalar = scalar_type(type);
  if (!scalar) return bad(file, place, in_quotes(type), " is not a PLY type");
  property.type = *scalar;
  property.name = words.next();
  if (property.name.empty()) return bad(file, place, "a property without a name");
  return property;
}

// Faces have normals in some files: of no use to a reader, but moved with the rest.
int normal_of(const Property& property) {
  const int role = role_of(property.name);
  return role >= role_nx && role < role_red ? role : no_role;
}

// One pass over the declared properties: what each is for, and whether the whole makes sense.
Result<void> assign_roles(const File& file, Place place, Header& header) {
  const auto is_vertex = [](const Element& element) { return element.name == "vertex"; };
  const auto vertices = std::count_if(header.elements.begin(), header.elements.end(), is_vertex);
  if (vertices != 1) return bad(file, place, "the header declares ", vertices, " vertex elements, not one");
  for (Element& element : header.elements) {
    Roles roles;
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      Property& property = element.properties[i];
      if (is_vertex(element) && !property.length) property.role = role_of(property.name);
      if (file.mover && element.name == "face" && !property.length) property.role = normal_of(property);
      if (!roles.add(property.role))
        return bad(file, place, "two properties mean ", in_quotes(property.name));
      const bool corners = property.name == "vertex_indices" || property.name == "vertex_index";
      if (element.name != "face" || !property.length || !corners) continue;
      if (is_float(property.type)) return bad(file, place, "face vertices are not of an integer type");
      if (element.corners >= 0) return bad(file, place, "a face lists its vertices twice");
      element.corners = static_cast<int>(i);
    }
    if (!is_vertex(element)) {
      for (Property& property : element.properties)
        if (!roles.normals()) property.role = no_role;
      continue;
    }
    if (!roles.positions()) return bad(file, place, "the vertices have no x, y and z");
    for (Property& property : element.properties) {
      if (property.role >= role_red ? !roles.colors() : property.role >= role_nx && !roles.normals())
        property.role = no_role;
    }
  }
  return {};
}

Result<Header> parse_header(const File& file) {
  // Some old writers end lines with "\r" alone; the first line tells, and the rest of the header follows it.
  const std::string_view all = file.text();
  if (!all.starts_with("ply") || all.size() < 4 || (all[3] != '\n' && all[3] != '\r' && !is_blank(all[3])))
    return bad(file, Place::byte(0), "not a PLY file: ", in_quotes(all.substr(0, 8)), " instead of \"ply\"");
  const std::size_t first_end = all.find_first_of("\r\n");
  const bool old_mac = first_end < all.size() - 1 && all[first_end] == '\r' && all[first_end + 1] != '\n';
  const char line_end = old_mac ? '\r' : '\n';

  Header header;
  bool format = false;
  while (header.bytes < all.size()) {
    const std::size_t begin = header.bytes;
    const std::size_t end = std::min(all.find(line_end, begin), all.size());
    header.bytes = std::min(end + 1, all.size());
    const Place place = Place::line(++header.lines);
    Words words(all.substr(begin, end - begin));
    const std::string_view key = words.next();
    if (header.lines == 1 || key.empty() || key == "comment" || key == "obj_info") continue;
    if (key == "format") {
      const std::string_view name = words.next();
      if (name == "ascii") {
        header.encoding = Encoding::ascii;
      } else if (name == "binary_little_endian") {
        header.encoding = Encoding::little;
      } else if (name == "binary_big_endian") {
        header.encoding = Encoding::big;
      } else {
        return bad(file, place, in_quotes(name), " is not a PLY format");
      }
      format = true;
    } else if (key == "element") {
      Element element;
      element.name = words.next();
      const std::string_view count = words.next();
      if (!parse_integer(count, element.count))
        return bad(file, place, in_quotes(count), " is not a count of ", in_quotes(element.name));
      header.elements.push_back(std::move(element));
    } else if (key == "property") {
      if (header.elements.empty()) return bad(file, place, "a property before any element");
      auto property = parse_property(file, place, words);
      if (!property) return tl::unexpected(property.error());
      header.elements.back().properties.push_back(*property);
    } else if (key == "end_header") {
      if (!format) return bad(file, place, "the header has no format line");
      if (auto assigned = assign_roles(file, place, header); !assigned)
        return tl::unexpected(assigned.error());
      return header;
    } else {
      return bad(file, place, in_quotes(key), " is not a PLY header keyword");
    }
  }
  return bad(file, Place::byte(all.size()), "the header has no end_header line");
}

// What becomes of an integer colour is in [0, 1]; floating-point colours are left for the builder.
double color_scale(const Property& property) {
  if (property.role < role_red || is_float(property.type)) return 1;
  return property.type == ScalarType::u16 ? 1.0 / 65535 : 1.0 / 255;
}

class Body {
 public:
  Body(const File& file, const Header& header)
      : file_(file),
        header_(header),
        builder_(file, has(role_nx), has(role_red)),
        lines_(file.text().substr(header.bytes), header.lines),
        at_(header.bytes) {
    for (const Element& element : header.elements) {
      if (element.name == "vertex") vertices_ = element.count;
    }
  }

  Result<Geometry> parse() {
    for (const Element& element : header_.elements) {
      if (element.properties.empty() || element.count == 0) continue;
      auto read = header_.encoding == Encoding::ascii ? ascii(element) : binary(element);
      if (!read) return tl::unexpected(read.error());
    }
    return builder_.finish(faces_.finish());
  }

 private:
  bool has(int role) const {
    for (const Element& element : header_.elements) {
      if (element.name != "vertex") continue;
      for (const Property& property : element.properties) {
        if (property.role == role) return true;
      }
    }
    return false;
  }

  Result<void> corner(std::int64_t vertex, Place place) {
    if (vertex < 0 || static_cast<std::uint64_t>(vertex) >= vertices_)
      return bad(file_, place, "a face uses vertex ", vertex, "; there are ", vertices_);
    if (vertex > std::numeric_limits<std::uint32_t>::max())
      return bad(file_, place, "a face uses vertex ", vertex, "; the limit is 2^32 - 1");
    faces_.corner(static_cast<std::uint32_t>(vertex));
    return {};
  }

  Result<void> ascii(const Element& element) {
    // Every value takes a digit and a separator, but for the last of the file.
    const std::uint64_t least = 2 * element.properties.size();
    if (element.count > (lines_.remaining() + 1) / least) {
      return bad(file_, Place::line(lines_.number()), element.count, " rows of ", in_quotes(element.name),
                 " need at least ", product(element.count, least), " bytes, ", lines_.remaining(), " remain");
    }
    const bool vertex = element.name == "vertex";
    if (vertex) builder_.reserve(element.count);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      std::string_view line;
      if (!lines_.next_filled(line)) {
        return bad(file_, Place::line(lines_.number()), "the file ends after ", i, " of ", element.count,
                   " rows of ", in_quotes(element.name));
      }
      const Place place = Place::line(lines_.number());
      if (auto row = ascii_row(element, Words(line), place); !row) return row;
    }
    return {};
  }

  Result<void> ascii_row(const Element& element, Words words, Place place) {
    Row row{};
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      const Property& property = element.properties[i];
      const std::string_view word = words.next();
      if (word.empty()) return bad(file_, place, "no value for ", in_quotes(property.name));
      if (property.length) {
        std::uint64_t length = 0;
        if (!parse_integer(word, length)) return bad(file_, place, in_quotes(word), " is not a list length");
        const bool corners = static_cast<int>(i) == element.corners;
        if (auto list = ascii_list(property, length, words, place, corners); !list) return list;
      } else if (property.role != no_role) {
        if (!parse_number(word, row[property.role]))
          return bad(file_, place, in_quotes(property.name), " is ", in_quotes(word),
                     ", not a finite number");
        if (file_.mover) file_.mover->word(property.role, word, row[property.role], property.type);
        row[property.role] *= color_scale(property);
      }
    }
    if (const std::string_view extra = words.next(); !extra.empty())
      return bad(file_, place, in_quotes(extra), " after the last property of ", in_quotes(element.name));
    return end_row(element, row, place);
  }

  // From other elements nothing is read but the corners; what is told to a mover is a face's normal.
  Result<void> end_row(const Element& element, const Row& row, Place place) {
    if (element.name == "vertex") return builder_.add(row, place);
    return file_.mover ? file_.mover->end_row(file_, place) : Result<void>();
  }

  Result<void> ascii_list(const Property& property, std::uint64_t length, Words& words, Place place,
                          bool corners) {
    if (corners) faces_.begin();
    for (std::uint64_t k = 0; k < length; ++k) {
      const std::string_view word = words.next();
      if (word.empty())
        return bad(file_, place, in_quotes(property.name), " announces ", length, " values and has ", k);
      if (!corners) continue;
      std::int64_t vertex = 0;
      if (!parse_integer(word, vertex)) return bad(file_, place, in_quotes(word), " is not a vertex index");
      if (auto added = corner(vertex, place); !added) return added;
    }
    return {};
  }

  Result<void> binary(const Element& element) {
    std::uint64_t least = 0;
    bool lists = false;
    for (const Property& property : element.properties) {
      least += size_of(property.length.value_or(property.type));
      lists |= property.length.has_value();
    }
    const std::size_t remaining = file_.bytes.size() - at_;
    if (element.count > remaining / least) {
      return bad(file_, Place::byte(at_), element.count, " rows of ", in_quotes(element.name), " need ",
                 lists ? "at least " : "", product(element.count, least), " bytes, ", remaining, " remain");
    }
    const bool vertex = element.name == "vertex";
    if (!vertex && !lists) {
      at_ += element.count * least;
      return {};
    }
    if (vertex) builder_.reserve(element.count);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      if (auto row = lists ? binary_row(element) : fixed_row(element, least); !row) return row;
    }
    return {};
  }

  // A vertex without lists: its size is known, and so is that all of it is there.
  Result<void> fixed_row(const Element& element, std::uint64_t size) {
    Row row{};
    const std::byte* value = file_.bytes.data() + at_;
    for (const Property& property : element.properties) {
      if (property.role != no_role) load_value(property, value, row);
      value += size_of(property.type);
    }
    at_ += size;
    return builder_.add(row, Place::byte(at_ - size));
  }

  Result<void> binary_row(const Element& element) {
    const std::size_t begin = at_;
    Row row{};
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
      const Property& property = element.properties[i];
      if (auto there = need(1, size_of(property.length.value_or(property.type)), property); !there)
        return there;
      const std::byte* value = file_.bytes.data() + at_;
      if (property.length) {
        const auto length = load_as<std::int64_t>(*property.length, value, order());
        if (length < 0) return bad(file_, Place::byte(at_), "a list of ", length, " values");
        at_ += size_of(*property.length);
        const bool corners = static_cast<int>(i) == element.corners;
        if (auto list = binary_list(property, static_cast<std::uint64_t>(length), corners); !list)
          return list;
        continue;
      }
      if (property.role != no_role) load_value(property, value, row);
      at_ += size_of(property.type);
    }
    return end_row(element, row, Place::byte(begin));
  }

  void load_value(const Property& property, const std::byte* value, Row& row) {
    row[property.role] = load_as<double>(property.type, value, order()) * color_scale(property);
    if (file_.mover) file_.mover->number(property.role, property.type, value, order());
  }

  Result<void> binary_list(const Property& property, std::uint64_t length, bool corners) {
    const std::size_t size = size_of(property.type);
    if (auto there = need(length, size, property); !there) return there;
    if (corners) {
      faces_.begin();
      for (std::uint64_t k = 0; k < length; ++k) {
        const std::size_t at = at_ + k * size;
        const auto vertex = load_as<std::int64_t>(property.type, file_.bytes.data() + at, order());
        if (auto added = corner(vertex, Place::byte(at)); !added) return added;
      }
    }
    at_ += length * size;
    return {};
  }

  Result<void> need(std::uint64_t count, std::size_t size, const Property& property) const {
    const std::size_t remaining = file_.bytes.size() - at_;
    if (count <= remaining / size) return {};
    return bad(file_, Place::byte(at_), count, " values of ", in_quotes(property.name), " need ",
               product(count, size), " bytes, ", remaining, " remain");
  }

  std::endian order() const {
    return header_.encoding == Encoding::big ? std::endian::big : std::endian::little;
  }

  const File& file_;
  const Header& header_;
  CloudBuilder builder_;
  FanBuilder faces_;
  Lines lines_;
  std::size_t at_;
  std::uint64_t vertices_ = 0;
};

}  // namespace

Result<Geometry> parse_ply(const File& file) {
  auto header = parse_header(file);
  if (!header) return tl::unexpected(header.error());
  return Body(file, *header).parse();
}

}  // namespace bitr::io
