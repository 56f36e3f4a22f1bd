#!/usr/bin/env bash
# Installs the Debian packages that a build needs; calls apt only when one is missing.
#   tools/install_packages.sh [build|test]
set -euo pipefail

packages=(g++ cmake ninja-build libeigen3-dev libexpected-dev libnanoflann-dev nlohmann-json3-dev libzip-dev
          liblzf-dev libcli11-dev libfccp-dev libpng-dev libvulkan-dev glslc)
if [[ ${1:-build} == test ]]; then
  # Two Vulkan drivers that compute on the CPU: Mesa's lavapipe, and SwiftShader out of Chromium's package.
  packages+=(libgtest-dev libgmock-dev libbenchmark-dev mesa-vulkan-drivers chromium-common
             vulkan-validationlayers spirv-tools python3)
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  exit 0
fi

echo "Installing ${missing[*]}"
as_root=()
if ((EUID != 0)); then
  as_root=(sudo)
fi
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
