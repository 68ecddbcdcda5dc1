// SPDX-License-Identifier: BSL-1.0
#include "broker.hpp"

#include "driver/peer.hpp"
#include "perf/support/descriptor.hpp"
#include "perf/support/pinning.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::perf::peers {
namespace {

std::filesystem::path made_folder() {
    auto name = (std::filesystem::temp_directory_path() / "cles-peer-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
        throw std::runtime_error("cannot create a folder for the broker");
    }
    return name;
}

bool is_program(const std::string& path) { return ::access(path.c_str(), X_OK) == 0; }

[[noreturn]] void become(std::vector<std::string> words) {
    // Its output would be mixed with the figures.
    const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    ::dup2(nothing, STDOUT_FILENO);
    ::dup2(nothing, STDERR_FILENO);
    std::vector<char*> pointers;
    for (auto& each : words) {
        pointers.push_back(each.data());
    }
    pointers.push_back(nullptr);
    ::execv(pointers.front(), pointers.data());
    ::_exit(127);
}

} // namespace

broker::broker(const command& with)
    : folder_(made_folder()), process_(place_ends().server, [&](const child_process::announce& tell) {
          auto words = with(folder_);
          tell(is_program(words.front()) ? "found" : "missing " + words.front());
          if (is_program(words.front())) {
              become(std::move(words));
          }
      }) {
    if (const auto word = process_.announced(); word != "found") {
        std::filesystem::remove_all(folder_);
        throw not_offered(word + " is not installed");
    }
}

broker::~broker() {
    std::error_code nothing;
    std::filesystem::remove_all(folder_, nothing);
}

std::uint16_t free_port(int kind_of_socket) {
    const descriptor probe{checked(::socket(AF_INET, kind_of_socket | SOCK_CLOEXEC, 0), "socket")};
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    checked(::bind(probe.get(), generic, length), "bind");
    checked(::getsockname(probe.get(), generic, &length), "getsockname");
    return ntohs(address.sin_port);
}

std::string first_line_of(const std::string& command) {
    struct closing {
        void operator()(std::FILE* output) const noexcept { ::pclose(output); }
    };
    const std::unique_ptr<std::FILE, closing> output{::popen((command + " 2>/dev/null").c_str(), "re")};
    std::array<char, 256> line{};
    if (!output || std::fgets(line.data(), static_cast<int>(line.size()), output.get()) == nullptr) {
        return "no " + command.substr(0, command.find(' '));
    }
    std::string found{line.data()};
    return found.substr(0, found.find('\n'));
}

} // namespace cles::perf::peers
