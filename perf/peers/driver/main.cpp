// SPDX-License-Identifier: BSL-1.0
// The driver of every peer: the program of a peer consists of this driver and the file that defines the peer.
#include "figures.hpp"
#include "options.hpp"

#include <cstdio>
#include <exception>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace {

namespace peers = cles::perf::peers;

constexpr int failed = 1;
constexpr int misused = 2;
constexpr int skipped = 77;

int run(peers::options how) {
    if (how.help) {
        std::printf("Measures %s between two processes of this host.\n\n%s", peers::about.name, peers::usage);
        return 0;
    }
    if (how.only_about) {
        std::printf("%s\n", peers::about_text().c_str());
        return 0;
    }
    const std::string_view carriers = peers::about.carriers;
    if (how.over.empty()) {
        how.over = carriers.substr(0, carriers.find(' '));
    } else if ((' ' + std::string{carriers} + ' ').find(' ' + how.over + ' ') == std::string::npos) {
        throw std::invalid_argument("--over takes one of: " + std::string{carriers});
    }
    std::printf("%s\n", to_text(how, measure(how)).c_str());
    return 0;
}

} // namespace

int main(int argc, char** argv) {
    int result = failed;
    try {
        result = run(peers::read_options({argv, static_cast<std::size_t>(argc)}));
    } catch (const std::invalid_argument& wrong) {
        std::fprintf(stderr, "cles_peer: %s\n", wrong.what());
        result = misused;
    } catch (const peers::not_offered& why) {
        std::fprintf(stderr, "cles_peer: not offered: %s\n", why.what());
        result = skipped;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_peer: %s\n", failure.what());
    }
    return result;
}
