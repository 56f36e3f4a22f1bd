#include "manifest.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "core/hash.hpp"
#include "io/formats.hpp"
#include "io/quote.hpp"
#include "pose_file.hpp"
#include "table_row.hpp"

namespace bitr::tool {
namespace {

/// Room for long names of files, and not for a file that is no manifest at all.
constexpr std::size_t most_line_bytes = std::size_t{1} << 20;

}  // namespace

class Manifest::Lines {
 public:
  Lines(const std::string& path, std::ifstream file)
      : path_(path), folder_(std::filesystem::path(path).parent_path()), file_(std::move(file)) {}
  virtual ~Lines() = default;

  /// What stands before the pairs.
  virtual Result<void> read_head() { return {}; }

  Result<std::optional<ManifestEntry>> next() {
    ManifestEntry entry;
    entry.number = number_;
    auto read = read_line(entry);
    if (read && *read) read = check(entry);
    ++number_;
    if (!read) return in_line(read.error());
    if (!*read) return std::nullopt;
    if (entry.name.empty()) entry.name = "pair " + std::to_string(entry.number);
    for (std::string* file : {&entry.source, &entry.reference, &entry.truth})
      if (!file->empty()) *file = (folder_ / *file).string();
    return entry;
  }

 protected:
  /// Whether there was one; errors without file and line.
  virtual Result<bool> read_line(ManifestEntry& entry) = 0;

  /// The next line that is not blank, whether there was one, or what is wrong with it.
  Result<bool> next_filled(std::string& line) {
    do {
      bool fits = true;
      if (const auto read = read_whole(line, fits); !read || !*read) return read;
      if (!fits)
        return fail(ErrorCode::bad_file, "is over " + std::to_string(most_line_bytes) + " bytes, the limit");
    } while (line.find_first_not_of(" \t\r") == std::string::npos);
    return true;
  }

  /// Where there is no line to blame it is the file that is named alone.
  tl::unexpected<Error> in_line(const Error& error) const {
    const std::string line =
        error.code == ErrorCode::io || line_ == 0 ? "" : ", line " + std::to_string(line_);
    return fail(error.code, path_ + line + ": " + error.message);
  }

 private:
  /// A line that does not fit is passed over like any other.
  Result<bool> read_whole(std::string& line, bool& fits) try {
    line.clear();
    std::streambuf& in = *file_.rdbuf();
    int c = in.sbumpc();
    if (c == EOF) return false;
    ++line_;
    for (; c != EOF && c != '\n'; c = in.sbumpc()) {
      fits = line.size() < most_line_bytes;
      if (fits) line += static_cast<char>(c);
    }
    constexpr std::string_view mark = "\xef\xbb\xbf";  // some editors put it before the text
    if (line_ == 1 && line.starts_with(mark)) line.erase(0, mark.size());
    return true;
  } catch (const std::ios_base::failure&) {
    return fail(ErrorCode::io, "cannot be read to its end");
  }

  static Result<bool> check(const ManifestEntry& entry) {
    for (const auto& [key, value] : {std::pair("source", &entry.source), {"reference", &entry.reference}})
      if (value->empty()) return fail(ErrorCode::bad_file, "names no " + std::string(key));
    for (const std::string* file : {&entry.source, &entry.reference, &entry.truth})
      if (file->find('\0') != std::string::npos)
        return fail(ErrorCode::bad_file, io::in_quotes(*file) + " is no name of a file");
    return true;
  }

  std::string path_;
  std::filesystem::path folder_;
  std::ifstream file_;
  std::uint64_t number_ = 0, line_ = 0;
};

namespace {

class Table : public Manifest::Lines {
 public:
  using Lines::Lines;

  Result<void> read_head() override {
    std::string line;
    const auto filled = next_filled(line);
    if (!filled) return in_line(filled.error());
    if (!*filled) return in_line({ErrorCode::bad_file, "is empty"});
    auto names = table_row(line);
    if (!names) return in_line(names.error());
    columns_ = std::move(*names);
    for (std::size_t i = 0; i < known.size(); ++i) {
      const auto named = std::count(columns_.begin(), columns_.end(), known[i]);
      if (named == 0 && i >= 2) continue;
      if (named != 1)
        return in_line(
            {ErrorCode::bad_file, std::string(named == 0 ? "names no column \"" : "names twice \"") +
                                      std::string(known[i]) + "\""});
    }
    return {};
  }

 protected:
  Result<bool> read_line(ManifestEntry& entry) override {
    std::string line;
    const auto filled = next_filled(line);
    if (!filled || !*filled) return filled;
    auto fields = table_row(line);
    if (!fields) return tl::unexpected(fields.error());
    if (fields->size() != columns_.size())
      return fail(ErrorCode::bad_file, "has " + std::to_string(fields->size()) + " fields for " +
                                           std::to_string(columns_.size()) + " columns");
    const std::array places = {&entry.source, &entry.reference, &entry.truth, &entry.name};
    for (std::size_t i = 0; i < known.size(); ++i)
      if (const auto at = std::find(columns_.begin(), columns_.end(), known[i]); at != columns_.end())
        *places[i] = std::move((*fields)[static_cast<std::size_t>(at - columns_.begin())]);
    return true;
  }

 private:
  static constexpr std::array<std::string_view, 4> known = {"source", "reference", "truth", "name"};
  std::vector<std::string> columns_;
};

class JsonLines : public Manifest::Lines {
 public:
  using Lines::Lines;

 protected:
  Result<bool> read_line(ManifestEntry& entry) override {
    std::string text;
    const auto filled = next_filled(text);
    if (!filled || !*filled) return filled;
    const Json json = Json::parse(text, nullptr, false);
    if (!json.is_object()) return fail(ErrorCode::bad_file, "is no JSON object");
    for (const auto& [key, value] : {std::pair("source", &entry.source),
                                     {"reference", &entry.reference},
                                     {"truth", &entry.truth},
                                     {"name", &entry.name}}) {
      const auto found = json.find(key);
      if (found == json.end() || found->is_null()) continue;
      if (!found->is_string()) return fail(ErrorCode::bad_file, "\"" + std::string(key) + "\" is no text");
      *value = found->get<std::string>();
    }
    if (const auto matrix = json.find("T_reference_source"); matrix != json.end()) {
      const auto pose = parse_pose(*matrix, "\"T_reference_source\"");
      if (!pose) return tl::unexpected(pose.error());
      entry.pose = *pose;
    }
    return true;
  }
};

}  // namespace

Manifest::Manifest(std::unique_ptr<Lines> lines) : lines_(std::move(lines)) {}
Manifest::Manifest(Manifest&&) noexcept = default;
Manifest& Manifest::operator=(Manifest&&) noexcept = default;
Manifest::~Manifest() = default;

Result<Manifest> Manifest::open(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return fail(ErrorCode::io, path + ": is a folder");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(ErrorCode::io, path + ": cannot be read");
  const std::string extension = io::extension_of(path);
  std::unique_ptr<Lines> lines;
  if (extension == ".jsonl" || extension == ".ndjson" || extension == ".json")
    lines = std::make_unique<JsonLines>(path, std::move(file));
  else
    lines = std::make_unique<Table>(path, std::move(file));
  if (const auto head = lines->read_head(); !head) return tl::unexpected(head.error());
  return Manifest(std::move(lines));
}

Result<std::optional<ManifestEntry>> Manifest::next() { return lines_->next(); }

Result<ManifestSummary> summarise_manifest(const std::string& path,
                                           const std::function<Result<void>(const ManifestEntry&)>& check) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    return fail(ErrorCode::io, path + ": is no regular file, which can be read more than once");
  auto manifest = Manifest::open(path);
  if (!manifest) return tl::unexpected(manifest.error());
  ManifestSummary summary;
  for (;; ++summary.pairs) {
    const auto entry = manifest->next();
    if (!entry && entry.error().code == ErrorCode::io) return tl::unexpected(entry.error());
    if (!entry) continue;
    if (!*entry) break;
    if (const auto good = check ? check(**entry) : Result<void>(); !good) return tl::unexpected(good.error());
  }
  std::ifstream file(path, std::ios::binary);
  summary.fingerprint = fnv1a_start;
  for (std::vector<char> block(1 << 16); file.read(block.data(), block.size()), file.gcount() > 0;)
    summary.fingerprint = fnv1a(std::as_bytes(std::span(block).first(file.gcount())), summary.fingerprint);
  return summary;
}

}  // namespace bitr::tool
