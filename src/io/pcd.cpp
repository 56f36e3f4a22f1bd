// PCD 0.7: a text header of fields, then points in text, binary rows, or LZF-compressed binary columns.
#include <lzf.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/lzf.hpp"
#include "io/mover.hpp"
#include "io/scalar.hpp"

namespace bitr::io {
namespace {

constexpr int packed_color = role_count;  // one 0x00RRGGBB value, stored as an integer or as a float's bits
constexpr std::size_t max_fields = 1024;
// LZF packs 88 bytes that repeat into one, which a few bytes of file could turn into any amount of memory. No
// cloud that was measured repeats itself so; one that was made up may, while it is no larger than this.
constexpr std::uint64_t most_repeated_points = std::uint64_t{1} << 22;

struct Field {
  std::string_view name;
  std::uint32_t size = 0, count = 1;
  char type = 0;
  int role = no_role;
  std::uint64_t first_column = 0, offset = 0;  ///< within a row, in values and in bytes
  ScalarType scalar = ScalarType::f32;
};

enum class Data { ascii, binary, compressed };

struct Header {
  std::vector<Field> fields;
  std::uint64_t points = 0, columns = 0, row_bytes = 0;
  Data data = Data::ascii;
  std::size_t lines = 0, bytes = 0;
  bool normals = false, colors = false;
  std::optional<Vec3d> viewpoint;
};

std::optional<ScalarType> scalar_type(char type, std::uint32_t size) {
  if (size != 1 && size != 2 && size != 4 && size != 8) return std::nullopt;
  const int step = std::countr_zero(size);
  constexpr ScalarType integers[2][4] = {{ScalarType::i8, ScalarType::i16, ScalarType::i32, ScalarType::i64},
                                         {ScalarType::u8, ScalarType::u16, ScalarType::u32, ScalarType::u64}};
  if (type == 'I') return integers[0][step];
  if (type == 'U') return integers[1][step];
  if (type == 'F' && size >= 4) return size == 4 ? ScalarType::f32 : ScalarType::f64;
  return std::nullopt;
}

Result<void> place_fields(const File& file, Place place, Header& header) {
  if (header.fields.empty()) return bad(file, place, "the header has no FIELDS");
  Roles roles;
  for (Field& field : header.fields) {
    field.first_column = header.columns;
    field.offset = header.row_bytes;
    const std::uint64_t bytes = std::uint64_t{field.size} * field.count;
    if (field.size == 0 || field.count == 0 || bytes > file.bytes.size() - header.row_bytes) {
      return bad(file, place, "field ", in_quotes(field.name), " has SIZE ", field.size, " and COUNT ",
                 field.count, "; a row must hold something and fit in the file's ", file.bytes.size(),
                 " bytes");
    }
    header.columns += field.count;
    header.row_bytes += bytes;
    field.role = field.name == "rgb" || field.name == "rgba" ? packed_color : role_of(field.name);
    if (field.role == no_role) continue;
    const auto scalar = scalar_type(field.type, field.size);
    if (!scalar || (field.role == packed_color && field.size != 4)) {
      return bad(file, place, "field ", in_quotes(field.name), " has TYPE ",
                 in_quotes(std::string_view(&field.type, 1)), " and SIZE ", field.size,
                 ", which is no number");
    }
    field.scalar = *scalar;
    const bool taken =
        field.role == packed_color ? std::exchange(header.colors, true) : !roles.add(field.role);
    if (taken) return bad(file, place, "two fields mean ", in_quotes(field.name));
  }
  if (!roles.positions()) return bad(file, place, "no fields x, y and z");
  header.normals = roles.normals();
  for (Field& field : header.fields) {
    const bool normal = field.role >= role_nx && field.role < role_red;
    const bool separate_color = field.role >= role_red && field.role < role_count;
    if ((normal && !header.normals) || separate_color) field.role = no_role;
  }
  return {};
}

/// Where the sensor stood: the first three of seven numbers. The header of a cloud that nobody knows this of has a
/// viewpoint that moves nothing, or none at all; what is no viewpoint has never been an error.
std::optional<Vec3d> parse_viewpoint(Words words) {
  std::array<double, 7> numbers{};
  for (double& number : numbers)
    if (!parse_number(words.next(), number) || !std::isfinite(number)) return {};
  constexpr std::array<double, 7> unmoved = {0, 0, 0, 1, 0, 0, 0};
  if (numbers == unmoved) return {};
  return Vec3d{numbers[0], numbers[1], numbers[2]};
}

Result<Header> parse_header(const File& file) {
  Header header;
  Lines lines(file.text());
  std::optional<std::uint64_t> width, height, points;
  bool version = false;
  std::string_view line;
  while (lines.next_filled(line)) {
    const Place place = Place::line(lines.number());
    Words words(line);
    const std::string_view key = words.next();
    if (key[0] == '#') continue;
    if (key == "VIEWPOINT") {
      header.viewpoint = parse_viewpoint(words);
      continue;
    }
    if (key == "VERSION") {
      version = true;
    } else if (key == "FIELDS" || key == "COLUMNS") {
      header.fields.clear();
      for (auto name = words.next(); !name.empty(); name = words.next()) {
        if (header.fields.size() == max_fields) return bad(file, place, "over ", max_fields, " fields");
        header.fields.emplace_back();
        header.fields.back().name = name;
      }
    } else if (key == "SIZE" || key == "TYPE" || key == "COUNT") {
      for (Field& field : header.fields) {
        const std::string_view word = words.next();
        bool good = key == "TYPE" && word.size() == 1;
        if (key == "SIZE") good = parse_integer(word, field.size);
        if (key == "COUNT") good = parse_integer(word, field.count);
        if (!good) {
          return bad(file, place, key, " of field ", in_quotes(field.name), " is ", in_quotes(word));
        }
        if (key == "TYPE") field.type = word[0];
      }
      if (const auto extra = words.next(); !extra.empty())
        return bad(file, place, key, " has more values than there are fields: ", in_quotes(extra));
    } else if (key == "WIDTH" || key == "HEIGHT" || key == "POINTS") {
      std::uint64_t count = 0;
      const std::string_view word = words.next();
      if (!parse_integer(word, count)) return bad(file, place, key, " is ", in_quotes(word), ", not a count");
      (key == "WIDTH" ? width : key == "HEIGHT" ? height : points) = count;
    } else if (key == "DATA") {
      const std::string_view word = words.next();
      if (word == "ascii") {
        header.data = Data::ascii;
      } else if (word == "binary") {
        header.data = Data::binary;
      } else if (word == "binary_compressed") {
        header.data = Data::compressed;
      } else {
        return bad(file, place, in_quotes(word), " is not a PCD data type");
      }
      if (width && height) {
        if (*height != 0 && *width > std::numeric_limits<std::uint64_t>::max() / *height)
          return bad(file, place, *width, " x ", *height, " points are over 2^64");
        if (!points) points = *width * *height;
        if (*points != *width * *height)
          return bad(file, place, *points, " POINTS are not ", *width, " x ", *height);
      }
      if (!points) return bad(file, place, "the header has neither POINTS nor WIDTH and HEIGHT");
      header.points = *points;
      header.lines = lines.number();
      header.bytes = lines.offset();
      if (auto placed = place_fields(file, place, header); !placed) return tl::unexpected(placed.error());
      return header;
    } else {
      const std::string_view advice =
          version ? " is not a PCD header keyword" : " does not start a PCD header";
      return bad(file, place, in_quotes(key), advice);
    }
  }
  return bad(file, Place::byte(file.bytes.size()), "the header has no DATA line");
}

void unpack_color(std::uint32_t rgb, Row& row) {
  for (int i = 0; i < 3; ++i) row[role_red + i] = static_cast<double>(rgb >> (16 - 8 * i) & 255) / 255;
}

// Text holds a packed colour as the integer itself, or as the float with the same bits.
bool parse_packed_color(std::string_view word, Row& row) {
  std::uint32_t rgb = 0;
  double number = 0;
  if (!parse_integer(word, rgb)) {
    if (!parse_number(word, number) || !(std::abs(number) <= std::numeric_limits<float>::max())) return false;
    rgb = std::bit_cast<std::uint32_t>(static_cast<float>(number));
  }
  unpack_color(rgb, row);
  return true;
}

Result<Geometry> parse_ascii(const File& file, const Header& header) {
  Lines lines(file.text().substr(header.bytes), header.lines);
  // Every value takes a digit and a separator, but for the last of the file.
  const std::uint64_t least = 2 * header.columns;
  if (header.points > (lines.remaining() + 1) / least) {
    return bad(file, Place::line(header.lines), header.points, " points need at least ",
               product(header.points, least), " bytes, ", lines.remaining(), " remain");
  }
  CloudBuilder builder(file, header.normals, header.colors);
  builder.reserve(header.points);
  for (std::uint64_t i = 0; i < header.points; ++i) {
    std::string_view line;
    if (!lines.next_filled(line)) {
      return bad(file, Place::line(lines.number()), "the file ends after ", i, " of ", header.points,
                 " points");
    }
    const Place place = Place::line(lines.number());
    Words words(line);
    Row row{};
    for (const Field& field : header.fields) {
      for (std::uint32_t k = 0; k < field.count; ++k) {
        const std::string_view word = words.next();
        if (word.empty()) return bad(file, place, "no value for ", in_quotes(field.name));
        if (field.role == no_role || k > 0) continue;
        const bool good =
            field.role == packed_color ? parse_packed_color(word, row) : parse_number(word, row[field.role]);
        if (!good) return bad(file, place, in_quotes(field.name), " is ", in_quotes(word), ", not a number");
        if (file.mover && field.role != packed_color)
          file.mover->word(field.role, word, row[field.role], field.scalar);
      }
    }
    if (const auto extra = words.next(); !extra.empty())
      return bad(file, place, in_quotes(extra), " after the last of ", header.columns, " values");
    if (auto added = builder.add(row, place); !added) return tl::unexpected(added.error());
  }
  return builder.finish();
}

/// The values of a field that means something: where the first one stands, and how far they are apart.
struct Values {
  const Field* field;
  const std::byte* first;
  std::uint64_t stride;
};

// Rows and columns of binary data differ only in where values stand. `row_bytes`: how far a row's place in the
// file is from the one before.
Result<Geometry> parse_table(const File& file, const Header& header, std::span<const Values> columns,
                             std::uint64_t row_bytes) {
  CloudBuilder builder(file, header.normals, header.colors);
  builder.reserve(header.points);
  for (std::uint64_t i = 0; i < header.points; ++i) {
    Row row{};
    for (const auto& [field, first, stride] : columns) {
      const std::byte* at = first + i * stride;
      if (field->role == packed_color) {
        unpack_color(load<std::uint32_t>(at), row);
      } else {
        row[field->role] = load_as<double>(field->scalar, at);
        if (file.mover) file.mover->number(field->role, field->scalar, at);
      }
    }
    if (auto added = builder.add(row, Place::byte(header.bytes + i * row_bytes)); !added)
      return tl::unexpected(added.error());
  }
  return builder.finish();
}

Result<Geometry> parse_binary(const File& file, const Header& header) {
  const auto table = file.bytes.subspan(header.bytes);
  if (header.points > table.size() / header.row_bytes) {
    return bad(file, Place::byte(header.bytes), header.points, " points need ",
               product(header.points, header.row_bytes), " bytes, ", table.size(), " remain");
  }
  std::vector<Values> columns;
  for (const Field& field : header.fields)
    if (field.role != no_role) columns.push_back({&field, table.data() + field.offset, header.row_bytes});
  return parse_table(file, header, columns, header.row_bytes);
}

// The two sizes, then the block; empty when it is too large for them.
std::vector<std::byte> compressed(std::span<const std::byte> table) {
  // What LZF cannot shorten grows by a byte in 32.
  const std::uint64_t most = table.size() + table.size() / 16 + 64;
  if (most > std::numeric_limits<std::uint32_t>::max()) return {};
  std::vector<std::byte> block(8 + most);
  const auto unpacked = static_cast<std::uint32_t>(table.size());
  const std::uint32_t packed =
      lzf_compress(table.data(), unpacked, block.data() + 8, static_cast<std::uint32_t>(most));
  std::memcpy(block.data(), &packed, 4);
  std::memcpy(block.data() + 4, &unpacked, 4);
  block.resize(8 + packed);
  return block;
}

/// A column after the other: of each value of a field that means something, and of nothing else.
class Columns {
 public:
  explicit Columns(const Header& header) : points_(header.points) {
    for (const Field& field : header.fields)
      if (field.role != no_role) columns_.push_back({&field, std::vector<std::byte>(points_ * field.size)});
  }

  /// A part of the unpacked block, which has every field's values, one field after the other.
  void take(std::uint64_t offset, std::span<const std::byte> piece) {
    const std::uint64_t end = offset + piece.size();
    for (auto& [field, kept] : columns_) {
      const std::uint64_t stride = std::uint64_t{field->size} * field->count, begin = points_ * field->offset;
      std::uint64_t i = offset > begin ? (offset - begin) / stride : 0;
      // The first of several values counts.
      for (std::uint64_t value = begin + i * stride; i < points_ && value < end; ++i, value += stride) {
        const std::uint64_t from = std::max(value, offset), to = std::min(value + field->size, end);
        if (from < to) std::memcpy(&kept[i * field->size + (from - value)], &piece[from - offset], to - from);
      }
    }
  }

  std::vector<Values> values() const {
    std::vector<Values> all;
    for (const auto& [field, kept] : columns_) all.push_back({field, kept.data(), field->size});
    return all;
  }

 private:
  std::uint64_t points_;
  std::vector<std::pair<const Field*, std::vector<std::byte>>> columns_;
};

/// The sizes in front of a compressed block, and the block.
struct Block {
  std::uint32_t unpacked = 0;
  std::span<const std::byte> packed;
};

Result<Block> compressed_block(const File& file, const Header& header) {
  const auto rest = file.bytes.subspan(header.bytes);
  const Place place = Place::byte(header.bytes);
  if (rest.size() < 8) return bad(file, place, "the two block sizes need 8 bytes, ", rest.size(), " remain");
  const auto packed = load<std::uint32_t>(rest.data());
  const auto unpacked = load<std::uint32_t>(rest.data() + 4);
  if (packed > rest.size() - 8)
    return bad(file, place, "a compressed block of ", packed, " bytes, ", rest.size() - 8, " remain");
  if (header.points > unpacked / header.row_bytes || header.points * header.row_bytes != unpacked) {
    return bad(file, place, header.points, " points need ", product(header.points, header.row_bytes),
               " bytes, the block holds ", unpacked);
  }
  // LZF spends three bytes on at most 264, so a larger claim is a lie and is refused before memory is taken.
  if (unpacked / 88 > packed) {
    return bad(file, place, packed, " compressed bytes cannot hold ", unpacked, "; LZF's limit is 88 to 1");
  }
  if (header.points > std::max<std::uint64_t>(most_repeated_points, packed))
    return bad(file, place, header.points, " points in ", packed, " compressed bytes; more than ",
               most_repeated_points, " need a byte each");
  if (unpacked == 0) return refuse(ErrorCode::bad_file, file, "no points");
  return Block{unpacked, rest.subspan(8, packed)};
}

template <class Take>
Result<void> unpack(const File& file, const Header& header, const Block& block, Take take) {
  const LzfUnpacked done = unpack_lzf(block.packed, block.unpacked, take);
  if (done.whole) return {};
  return bad(file, Place::byte(header.bytes + 8), "the LZF block is damaged after ", done.bytes, " of ",
             block.unpacked, " bytes");
}

Result<Geometry> move_compressed(const File& file, const Header& header, const Block& block) {
  std::vector<std::byte> table(block.unpacked);
  const auto keep = [&](std::uint64_t offset, std::span<const std::byte> piece) {
    std::copy(piece.begin(), piece.end(), table.begin() + static_cast<std::ptrdiff_t>(offset));
  };
  if (auto good = unpack(file, header, block, keep); !good) return tl::unexpected(good.error());
  file.mover->work_in(table);
  std::vector<Values> columns;
  for (const Field& field : header.fields)
    if (field.role != no_role)
      columns.push_back(
          {&field, table.data() + header.points * field.offset, std::uint64_t{field.size} * field.count});
  auto read = parse_table(file, header, columns, 0);
  if (!read) return read;
  const auto moved = compressed(table);
  if (moved.empty()) return refuse(ErrorCode::unsupported, file, "the moved block is over 2^32 bytes");
  file.mover->replace(header.bytes, header.bytes + 8 + block.packed.size(), moved);
  return read;
}

Result<Geometry> parse_compressed(const File& file, const Header& header) {
  const auto block = compressed_block(file, header);
  if (!block) return tl::unexpected(block.error());
  if (file.mover) return move_compressed(file, header, *block);
  Columns columns(header);
  const auto good = unpack(file, header, *block, [&](std::uint64_t offset, std::span<const std::byte> piece) {
    columns.take(offset, piece);
  });
  if (!good) return tl::unexpected(good.error());
  return parse_table(file, header, columns.values(), 0);
}

}  // namespace

Result<Geometry> parse_pcd(const File& file) {
  auto header = parse_header(file);
  if (!header) return tl::unexpected(header.error());
  auto geometry = header->data == Data::ascii    ? parse_ascii(file, *header)
                  : header->data == Data::binary ? parse_binary(file, *header)
                                                 : parse_compressed(file, *header);
  if (geometry) geometry->viewpoint = header->viewpoint;
  return geometry;
}

}  // namespace bitr::io
