// SPDX-License-Identifier: BSL-1.0
// Runs inputs from files, without a fuzzer: inputs that once revealed a fault are repeated in every build.
//
//     fuzz_replay_TARGET FOLDER|FILE...
#include "fuzz/fuzz.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace {

std::vector<std::filesystem::path> files_of(int argc, char** argv) {
    std::vector<std::filesystem::path> files;
    for (int i = 1; i < argc; ++i) {
        const std::filesystem::path place{argv[i]};
        if (std::filesystem::is_directory(place)) {
            for (const auto& entry : std::filesystem::directory_iterator{place}) {
                files.push_back(entry.path());
            }
        } else {
            files.push_back(place);
        }
    }
    std::sort(files.begin(), files.end());
    return files;
}

} // namespace

int main(int argc, char** argv) {
    const auto files = files_of(argc, argv);
    for (const auto& path : files) {
        std::ifstream file{path, std::ios::binary};
        if (!file) {
            std::fprintf(stderr, "%s cannot be read\n", path.c_str());
            return 1;
        }
        const std::string input{std::istreambuf_iterator<char>{file}, {}};
        std::fprintf(stderr, "%s\n", path.filename().c_str()); // the last one printed is the one that fails
        cles::fuzz::run(input);
    }
    std::fprintf(stderr, "%zu inputs\n", files.size());
    return files.empty() ? 1 : 0;
}
