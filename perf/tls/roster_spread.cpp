// SPDX-License-Identifier: BSL-1.0
// How long a new roster takes to reach all daemons of a fleet. The daemons run on this host and find each other in the
// multicast group on loopback, so run it in a network namespace of its own (test/support/isolated). A member is added,
// the new roster is put into the directory of one daemon, and the others get it from that one.
//
//   cles_roster_spread CLESD [DAEMONS [MEMBERS [MOST_SECONDS]]]
//
// Fails if it takes longer than 5 seconds, or than MOST_SECONDS.
#include "perf/support/descriptor.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/key_directory.hpp"
#include "support/temporary_folder.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>

namespace cles::perf {
namespace {

using steady = std::chrono::steady_clock;

constexpr std::chrono::seconds patience{120};

double seconds(steady::duration span) { return std::chrono::duration<double>(span).count(); }

/// `clesd` with the keys of a member, in a directory of that name.
class daemon_process {
  public:
    daemon_process(const std::string& program, const test::temporary_folder& in, std::string name)
        : name_(std::move(name)), keys_((in / name_).string()), socket_((in / (name_ + ".sock")).string()) {
        const std::vector<std::string> words{program,
                                             "--config",
                                             (in / "empty.yaml").string(),
                                             "--keys",
                                             keys_,
                                             "--multicast",
                                             "lo",
                                             "--listen",
                                             "tls://127.0.0.1:0",
                                             "--listen",
                                             "udp://127.0.0.1:0",
                                             "--listen",
                                             "unix://" + socket_,
                                             "--log",
                                             "error"};
        id_ = checked(::fork(), "fork");
        if (id_ == 0) {
            run(words);
        }
    }
    daemon_process(const daemon_process&) = delete;
    daemon_process& operator=(const daemon_process&) = delete;
    ~daemon_process() {
        ::kill(id_, SIGKILL);
        while (::waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
        }
    }

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] security::key_directory keys() const { return security::key_directory{keys_}; }
    /// The reply to a request; empty if it does not accept links yet.
    [[nodiscard]] std::string ask(std::string_view request) const {
        const descriptor link{checked(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), "socket")};
        sockaddr_un to{};
        to.sun_family = AF_UNIX;
        socket_.copy(to.sun_path, sizeof to.sun_path - 1);
        if (::connect(link.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
            return {};
        }
        const auto line = std::string{request} + "\n";
        checked(::send(link.get(), line.data(), line.size(), MSG_NOSIGNAL), "send");
        std::string reply;
        while (!reply.ends_with('\n')) {
            std::array<char, 16384> bytes{};
            const auto count = checked(::recv(link.get(), bytes.data(), bytes.size(), 0), "recv");
            if (count == 0) {
                throw std::runtime_error(name_ + " closed its link");
            }
            reply.append(bytes.data(), static_cast<std::size_t>(count));
        }
        return reply;
    }
    [[nodiscard]] std::size_t others() const {
        const auto peers = ask("PULL self:cles/peers");
        constexpr std::string_view live = R"("state":"live")";
        std::size_t found = 0;
        for (auto at = peers.find(live); at != std::string::npos; at = peers.find(live, at + 1)) {
            ++found;
        }
        return found;
    }
    /// The version that it has stored, which it does when it is in force. Reads a few bytes, so that the daemons keep
    /// the cores.
    [[nodiscard]] std::uint32_t stored_version() const {
        std::array<char, 400> head{};
        std::ifstream{keys_ + "/roster", std::ios::binary}.read(head.data(), head.size() - 1);
        constexpr std::string_view key = R"("version":)";
        const auto at = std::string_view{head.data()}.find(key);
        return at == std::string_view::npos
                   ? 0
                   : static_cast<std::uint32_t>(std::strtoul(head.data() + at + key.size(), nullptr, 10));
    }

  private:
    [[noreturn]] static void run(const std::vector<std::string>& words) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        const auto null = ::open("/dev/null", O_WRONLY);
        ::dup2(null, STDOUT_FILENO); // where it listens
        for (const auto* variable : {"CLES_NODE", "CLES_POOL", "CLES_LISTEN", "CLES_SEEDS", "CLES_MULTICAST",
                                     "CLES_KEYS", "CLES_LOG", "CLES_CONFIG"}) {
            ::unsetenv(variable);
        }
        std::vector<char*> arguments;
        arguments.reserve(words.size() + 1);
        for (const auto& word : words) {
            arguments.push_back(const_cast<char*>(word.c_str()));
        }
        arguments.push_back(nullptr);
        ::execv(arguments.front(), arguments.data());
        std::cerr << "cannot run " << words.front() << "\n";
        ::_exit(127);
    }

    std::string name_;
    std::string keys_;
    std::string socket_;
    pid_t id_ = -1;
};

template <class Condition>
void wait_until(Condition&& holds, std::chrono::milliseconds pause, const char* what) {
    const auto end = steady::now() + patience;
    while (!holds()) {
        if (steady::now() > end) {
            throw std::runtime_error(std::string{"waited in vain: "} + what);
        }
        std::this_thread::sleep_for(pause);
    }
}

class spreading_fleet {
  public:
    spreading_fleet(const std::string& program, std::size_t daemons, std::size_t members) {
        const std::ofstream empty{folder_ / "empty.yaml"}; // so that a configuration of this host does not count
        std::vector<security::public_identity> all;
        for (std::size_t i = 0; i < members; ++i) {
            const auto name = "m" + std::to_string(i);
            all.push_back(
                i < daemons ? security::key_directory::create((folder_ / name).string()).create_key(name).public_part()
                            : security::public_identity{name, security::signing_key::generate().public_part()});
        }
        authority_.add(all);
        for (std::size_t i = 0; i < daemons; ++i) {
            security::key_directory{(folder_ / all[i].name).string()}.store_roster(authority_.newest());
            daemons_.push_back(std::make_unique<daemon_process>(program, folder_, all[i].name));
        }
    }

    void await_discovery() {
        for (const auto& each : daemons_) {
            wait_until([&] { return each->others() == daemons_.size() - 1; }, std::chrono::milliseconds{100},
                       "for the daemons to know each other");
        }
    }
    /// A member is added. Returns when each daemon had the new roster, in ascending order.
    std::vector<double> spread() {
        authority_.add({"new", security::signing_key::generate().public_part()});
        const auto version = authority_.newest().version();
        const auto begun = steady::now();
        daemons_.front()->keys().store_roster(authority_.newest());
        std::vector<const daemon_process*> waiting;
        for (const auto& each : daemons_) {
            waiting.push_back(each.get());
        }
        std::vector<double> times;
        wait_until(
            [&] {
                std::erase_if(waiting, [&](const auto* each) {
                    const bool has_it = each->stored_version() == version;
                    if (has_it) {
                        times.push_back(seconds(steady::now() - begun));
                    }
                    return has_it;
                });
                return waiting.empty();
            },
            std::chrono::milliseconds{10}, "for the roster to reach all daemons");
        for (const auto& each : daemons_) {
            if (each->ask("PULL self:cles/roster") != authority_.newest().line() + "\n") {
                throw std::runtime_error("the roster that is in force at " + each->name() + " is another one");
            }
        }
        return times;
    }
    [[nodiscard]] std::size_t roster_bytes() const { return authority_.newest().line().size(); }

  private:
    test::temporary_folder folder_{"cles-spread"};
    security::fleet_authority authority_ = security::fleet_authority::found(security::signing_key::generate());
    std::vector<std::unique_ptr<daemon_process>> daemons_;
};

bool measure(const std::string& program, std::size_t daemons, std::size_t members, double most) {
    const auto begun = steady::now();
    spreading_fleet fleet{program, daemons, members};
    fleet.await_discovery();
    std::cout << daemons << " daemons know each other " << seconds(steady::now() - begun)
              << " s after the first start\n";
    // The directory of the first daemon has the new roster at once; the daemon itself within a second.
    const auto times = fleet.spread();
    std::cout << "a roster of " << members + 1 << " members, " << fleet.roster_bytes()
              << " bytes, has reached half of them after " << times[times.size() / 2] << " s, all after "
              << times.back() << " s; permitted " << most << " s\n";
    return times.back() <= most;
}

} // namespace
} // namespace cles::perf

int main(int count, char** arguments) {
    const auto number = [&](int at, std::size_t otherwise) {
        return count > at ? std::strtoull(arguments[at], nullptr, 10) : otherwise;
    };
    const auto daemons = number(2, 50);
    const auto members = number(3, 1'000);
    if (count < 2 || daemons < 2 || members < daemons || members > 3'000) {
        std::cerr << "Usage: cles_roster_spread CLESD [DAEMONS [MEMBERS [MOST_SECONDS]]]\n";
        return 2;
    }
    try {
        return cles::perf::measure(arguments[1], daemons, members, static_cast<double>(number(4, 5))) ? 0 : 1;
    } catch (const std::exception& e) {
        std::cerr << "cles_roster_spread: " << e.what() << "\n";
        return 1;
    }
}
