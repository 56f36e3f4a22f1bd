#!/usr/bin/env bash
# Installs the Debian packages that a build needs, and the npm packages of viewer/; calls apt and npm only when
# something is missing.
#   tools/install_packages.sh [build|test] [PACKAGE...]
set -euo pipefail

packages=(g++ cmake ninja-build libeigen3-dev libexpected-dev libnanoflann-dev nlohmann-json3-dev libzip-dev
          liblzf-dev libcli11-dev libpng-dev libvulkan-dev glslc)
packages+=("${@:2}")
if [[ ${1:-build} == test ]]; then
  # Two Vulkan drivers that compute on the CPU: Mesa's lavapipe, and SwiftShader out of Chromium's package. The
  # browser itself looks at pages.
  packages+=(libgtest-dev libgmock-dev libbenchmark-dev mesa-vulkan-drivers chromium
             vulkan-validationlayers spirv-tools python3)
fi

command -v npm >/dev/null || packages+=(nodejs npm)

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
if ((${#missing[@]} > 0)); then
  echo "Installing ${missing[*]}"
  as_root=()
  if ((EUID != 0)); then
    as_root=(sudo)
  fi
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
fi

# What npm has installed is listed in node_modules/.package-lock.json, written last.
cd "$(dirname "${BASH_SOURCE[0]}")/../viewer"
if [[ ! -e node_modules/.package-lock.json || node_modules/.package-lock.json -ot package-lock.json ]]; then
  echo "Installing the packages of viewer/"
  if npm ci --ignore-scripts --loglevel=error; then
    touch node_modules/.package-lock.json
  else
    rm -rf node_modules
    echo "npm ci failed in viewer/: the build goes on without bitr assemble --view" >&2
  fi
fi
