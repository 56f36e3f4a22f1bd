// The ways to find a pose that bitr eval compares.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/confidence.hpp>
#include <bitr/data.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace bitr::tool {

enum class MethodKind { identity, principal_axes, network, solve };

/// What may follow a method, in a row "name+suffix" of its own.
enum class Follow { icp, ot, trimmed_icp };
struct FollowName {
  Follow follow;
  std::string_view name;
};
inline constexpr FollowName follows[] = {
    {Follow::icp, "icp"}, {Follow::ot, "ot"}, {Follow::trimmed_icp, "trimmed-icp"}};
std::string_view name(Follow follow);

struct Method {
  std::string name;
  MethodKind kind = MethodKind::identity;
  bool plain = false;                ///< a row of its poses
  std::vector<Follow> refined = {};  ///< a row each, of its poses after that

  // What only a network has.
  std::string file = {};  ///< empty for complete-match
  std::optional<Model> model = {};
  std::optional<Plan> plan = {};  ///< made when it is needed
};

struct MethodChoice {
  std::vector<std::string> models;    ///< files
  std::vector<std::string> controls;  ///< see control_names, each perhaps with "+icp" or another
  std::vector<Follow> refined;        ///< rows for every model
  std::optional<Mode> mode = {};      ///< overrides the models'
};

inline constexpr std::string_view control_names = "solve, identity, pca-icp, complete-match";

/// Models first, then controls; all controls when nothing is chosen. Names differ: models of one name go by
/// their paths. The error names what is wrong.
Result<std::vector<Method>> choose_methods(const MethodChoice& choice);

/// How estimates are made, whatever the method.
struct Estimation {
  const Device& device;
  std::optional<Mode> mode;
  double keep;  ///< for trimmed ICP, as in refine::IcpOptions
  int answers;  ///< a trained network's passes over parts of the clouds, see resample()
};

/// T_reference_source of every sample.
struct Estimate {
  std::vector<Pose> poses;
  std::vector<std::optional<NetworkEvidence>> evidence = {};  ///< see Estimation::answers; else empty
  std::vector<Confidence> confidences = {};                   ///< that the method gave itself; else empty
  double beside_milliseconds = 0;                             ///< that making a plan took
};
Result<Estimate> estimate(Method& method, std::span<const DataSample> batch, const Estimation& how);
std::vector<CloudPair> pairs_of(std::span<const DataSample> batch);
/// Each pose after that; one that is not finite stays.
Result<std::vector<Pose>> refined(const std::vector<Pose>& poses, Follow follow,
                                  std::span<const DataSample> batch, const Estimation& how);

}  // namespace bitr::tool
