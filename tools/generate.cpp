// bitr generate: pairs of clouds with a known answer.
#include <CLI/CLI.hpp>
#include <bitr/data.hpp>
#include <bitr/generate.hpp>
#include <bitr/io.hpp>
#include <iostream>
#include <memory>
#include <optional>

#include "command.hpp"
#include "data_sets/part.hpp"
#include "io/formats.hpp"
#include "options.hpp"
#include "output.hpp"
#include "shape_files.hpp"

namespace bitr::tool {
namespace {

constexpr std::string_view crops = "crops";

struct GenerateCommandOptions {
  std::string kind, folder, shapes;
  io::PlyEncoding encoding = io::PlyEncoding::binary_little_endian;
  std::uint64_t count = 1, seed = 0, points = 2048;
  bool share_given = false, normals = false;
  GenerateOptions pair;
};

std::string numbered(const std::string& kind, std::uint64_t index) {
  std::string digits = std::to_string(index);
  if (digits.size() < 3) digits.insert(0, 3 - digits.size(), '0');
  return kind + "_" + digits;
}

struct PairFiles {
  std::string source, reference, truth;
};

PairFiles files_of(const std::string& name) {
  return {name + "_source.ply", name + "_reference.ply", name + "_truth.json"};
}

struct Made {
  GeneratedPair pair;
  std::string shape = {};  ///< its file, if it is of one
};

/// Makes pair after pair: of a kind, or of the shapes in a folder.
class Maker {
 public:
  static Result<Maker> open(const GenerateCommandOptions& options) {
    Maker maker(options);
    if (options.kind != crops) return maker;
    DataOptions data;
    data.parts.push_back({.folder = options.shapes,
                          .protocol = options.pair.protocol,
                          .share_low = options.pair.share,
                          .share_high = options.pair.share});
    data.points_low = data.points_high = options.points;
    data.noise = options.pair.noise;
    data.seed = options.seed;
    data.normals = options.normals;
    auto opened = DataSet::open(data);
    if (!opened) return tl::unexpected(opened.error());
    maker.data_ = std::move(*opened);
    return maker;
  }

  Result<Made> make(std::uint64_t index) const {
    if (data_) {
      auto sample = data_->sample(index / data_->samples(), index % data_->samples());
      if (!sample) return tl::unexpected(sample.error());
      return Made{{std::move(sample->source), std::move(sample->reference), sample->T_reference_source,
                   sample->T_source_object, sample->overlap, sample->symmetry},
                  sample->shape};
    }
    GenerateOptions options = options_.pair;
    options.seed = options_.seed + index;
    auto pair = generate_pair(options_.kind, options);
    if (!pair) return tl::unexpected(pair.error());
    return Made{std::move(*pair)};
  }

  void warn_of_skipped() const {
    const auto skipped = data_ ? data_->skipped() : std::vector<SkippedShape>{};
    if (!skipped.empty())
      warn(std::to_string(skipped.size()) + (skipped.size() == 1 ? " file was" : " files were") +
           " skipped; " + skipped[0].shape + ": " + skipped[0].reason);
  }

 private:
  explicit Maker(const GenerateCommandOptions& options) : options_(options) {}
  const GenerateCommandOptions& options_;
  std::optional<DataSet> data_;
};

Json truth_json(const Made& made, const GenerateCommandOptions& options, std::uint64_t index,
                const std::string& name) {
  const GeneratedPair& pair = made.pair;
  Json json = {{"kind", options.kind}};
  if (made.shape.empty()) {
    json["seed"] = options.seed + index;
  } else {
    json["seed"] = options.seed;
    json["sample"] = index;
    json["shape"] = made.shape;
  }
  json["points"] = options.points;
  json["noise"] = options.pair.noise;
  if (options.pair.protocol) {
    json["protocol"] = bitr::name(*options.pair.protocol);
    json["share"] = options.pair.share;
  } else {
    json["roughness"] = options.pair.roughness;
  }
  json["overlap"] = pair.overlap;
  json["symmetry"] = {{"axis", pair.symmetry.axis}, {"order", pair.symmetry.order}};
  const PairFiles files = files_of(name);
  json["source"] = files.source;
  json["reference"] = files.reference;
  json["T_reference_source"] = matrix_json(pair.T_reference_source);
  json["T_source_object"] = matrix_json(pair.T_source_object);
  return json;
}

Result<void> check(const GenerateCommandOptions& options) {
  if ((options.kind == crops) != !options.shapes.empty())
    return fail(ErrorCode::invalid_argument, options.shapes.empty() ? "crops needs --shapes PATH to crop from"
                                                                    : "--shapes is for the kind crops only");
  if (options.normals && options.kind != crops)
    return fail(ErrorCode::invalid_argument,
                "--normals is for the kind crops only; the others always have them");
  if (options.share_given && !options.pair.protocol)
    return fail(ErrorCode::invalid_argument, "--share needs a --protocol");
  return {};
}

Result<void> check_folder(const GenerateCommandOptions& options, const std::filesystem::path& folder) {
  std::error_code error;
  if (options.kind != crops || !std::filesystem::exists(folder, error)) return {};
  const auto shapes = shape_files(options.shapes);
  if (!shapes) return tl::unexpected(shapes.error());
  for (std::uint64_t i = 0; i < options.count; ++i) {
    const PairFiles files = files_of(numbered(options.kind, i));
    for (const std::string& file : {files.source, files.reference, files.truth})
      if (shapes->has(folder / file))
        return fail(ErrorCode::invalid_argument, "--out " + options.folder + ": " + file +
                                                     " would replace a shape of --shapes " + options.shapes);
  }
  return {};
}

int run(GenerateCommandOptions& options) {
  options.pair.points = options.points;
  const bool cropped_anyway = options.kind == crops || data::is_cropped({.kind = options.kind});
  if (cropped_anyway && !options.pair.protocol) options.pair.protocol = Protocol::opposed;
  if (const auto valid = check(options); !valid) return complain(valid.error());
  set_at_hand("pairs of " + std::to_string(options.points) + " points");
  const auto maker = Maker::open(options);
  if (!maker) return complain(maker.error());
  const std::filesystem::path folder = options.folder;
  if (const auto valid = check_folder(options, folder); !valid) return complain(valid.error());
  std::string manifest;
  for (std::uint64_t i = 0; i < options.count; ++i) {
    const auto made = maker->make(i);
    if (!made) return complain(made.error());
    if (i == 0)
      if (const auto there = make_folder("--out", options.folder); !there) return complain(there.error());
    const std::string name = numbered(options.kind, i);
    const PairFiles files = files_of(name);
    manifest +=
        Json{{"name", name}, {"source", files.source}, {"reference", files.reference}, {"truth", files.truth}}
            .dump() +
        "\n";
    const auto cloud = [&](const PointCloud& points) {
      return [&](const std::string& path) { return io::ply_file(path, points, options.encoding); };
    };
    // The list comes with the last pair: whatever stops the run, pairs are whole and a list tells the truth.
    const bool last = i + 1 == options.count;
    const auto written = write_files({{folder / files.source, cloud(made->pair.source)},
                                      {folder / files.reference, cloud(made->pair.reference)},
                                      json_writer(folder / files.truth, truth_json(*made, options, i, name)),
                                      {last ? (folder / (options.kind + ".jsonl")).string() : "",
                                       [&](const std::string&) { return bytes_of(manifest); }}});
    if (!written) return complain(written.error());
    show_progress(std::to_string(i + 1) + " of " + std::to_string(options.count));
  }
  clear_progress();
  maker->warn_of_skipped();
  std::cout << options.count << (options.count == 1 ? " pair" : " pairs") << " in " << options.folder << ", "
            << numbered(options.kind, 0) << "_{source,reference}.ply with _truth.json"
            << (options.count > 1 ? " and so on" : "") << ", and " << options.kind
            << ".jsonl for bitr batch\n";
  return done;
}

}  // namespace

Command add_generate(CLI::App& root) {
  auto options = std::make_shared<GenerateCommandOptions>();
  CLI::App* app = add_command(root, "generate", "Make pairs of clouds with a known answer");
  std::string kinds, names;
  for (const GeneratedKind& kind : generated_kinds())
    kinds += "  " + std::string(kind.name) + std::string(12 - kind.name.size(), ' ') +
             std::string(kind.summary) + "\n";
  for (const GeneratedKind& kind : generated_kinds()) names += std::string(kind.name) + "|";
  kinds += "  crops       two crops of a mesh or cloud that --shapes names\n";
  app->add_option("KIND", options->kind, "What to make, see below")
      ->required()
      ->type_name(names + std::string(crops));
  app->add_option("--out", options->folder, "Folder to write to; made if it is missing")
      ->required()
      ->type_name("DIR");
  add_count(*app, "--count", options->count, 1, 1'000'000, "Pairs to make");
  add_seed(*app, "--seed", options->seed,
           "Seed of the first pair, pair i takes seed + i; of all pairs for crops");
  add_count(*app, "--points", options->points, 1, max_generated_points,
            "Points of each cloud; of the whole object where it is cropped");
  app->add_option("--noise", options->pair.noise,
                  "Standard deviation added to every coordinate, clipped at 5 times that")
      ->type_name("LENGTH")
      ->capture_default_str();
  app->add_option("--roughness", options->pair.roughness, "Standard deviation of a break's relief")
      ->type_name("LENGTH")
      ->capture_default_str();
  const std::string explained =
      add_protocol(*app, options->pair.protocol,
                   "Crop the whole object in two, see below; opposed for aircraft and crops");
  app->add_option_function<double>(
         "--share",
         [options](double share) {
           options->pair.share = share;
           options->share_given = true;
         },
         "Share S of the object's points that a crop keeps, above 0 and up to 1")
      ->type_name("S")
      ->default_str("0.7");
  app->add_option(
         "--shapes", options->shapes,
         "Meshes and clouds to crop, in this folder and below, or one file; scaled to a radius of 0.5")
      ->type_name("PATH");
  app->add_flag("--normals", options->normals,
                "Crops have normals; clouds that have none are skipped (the other kinds always have them)");
  add_choice<io::PlyEncoding>(
      *app, "--format",
      {{"ply", io::PlyEncoding::binary_little_endian}, {"ply-ascii", io::PlyEncoding::ascii}},
      options->encoding, "Encoding of the clouds")
      ->default_str("ply");
  app->footer(
      "Kinds (every object fits in a ball of radius 0.5):\n" + kinds + "\nProtocols:\n" + explained +
      "\nPair 0 of KIND is KIND_000_source.ply, KIND_000_reference.ply and KIND_000_truth.json, which has\n"
      "the pose T_reference_source: x_reference = R x_source + t, and the share of the object in both "
      "clouds.\n\n"
      "Examples:\n"
      "  bitr generate vessels --out clouds --count 10 --seed 1 --points 4096\n"
      "  bitr generate aircraft --out clouds --protocol independent --share 0.6 --noise 0.01\n"
      "  bitr generate crops --shapes meshes --out clouds --count 10 --protocol complement --share 0.5");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
