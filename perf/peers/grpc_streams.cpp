// SPDX-License-Identifier: BSL-1.0
#include "grpc.hpp"
#include "localization.grpc.pb.h"

#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <vector>

namespace cles::perf::peers {
namespace {

wire::Publication to_wire(const publication& value) {
    wire::Publication made;
    made.set_published_ns(static_cast<std::uint64_t>(value.published_ns));
    auto& values = *made.mutable_value();
    values.set_utc(value.utc);
    values.set_lat(value.lat);
    values.set_lon(value.lon);
    values.set_velocity(value.velocity);
    values.set_acceleration(value.acceleration);
    return made;
}

publication from_wire(const wire::Publication& message) {
    const auto& values = message.value();
    publication made;
    static_cast<localization&>(made) = {values.utc(), values.lat(), values.lon(), values.velocity(),
                                        values.acceleration()};
    made.published_ns = static_cast<std::int64_t>(message.published_ns());
    return made;
}

/// To one subscriber.
class stream final : public ::grpc::ServerWriteReactor<wire::Publication> {
  public:
    void send(const wire::Publication& message) {
        std::unique_lock lock{guard_};
        free_.wait(lock, [this] { return !writing_; });
        if (gone_) {
            return;
        }
        message_ = message;
        writing_ = true;
        lock.unlock();
        StartWrite(&message_);
    }
    void OnWriteDone(bool) override {
        const std::lock_guard lock{guard_};
        writing_ = false;
        free_.notify_one();
    }
    void OnCancel() override {
        {
            const std::lock_guard lock{guard_};
            gone_ = true;
        }
        Finish(::grpc::Status::CANCELLED);
    }
    void OnDone() override {} // the service owns it

  private:
    std::mutex guard_;
    std::condition_variable free_;
    bool writing_ = false;
    bool gone_ = false;
    wire::Publication message_;
};

class subscription final : public ::grpc::ClientReadReactor<wire::Publication> {
  public:
    subscription(const std::string& where, std::size_t number, inbox& into)
        : number_(number), into_(into), stub_(own_channel(where)) {
        stub_.async()->Bind(&context_, &nothing_, this);
        StartRead(&message_);
        StartCall();
    }
    subscription(const subscription&) = delete;
    subscription& operator=(const subscription&) = delete;
    ~subscription() override {
        context_.TryCancel();
        std::unique_lock lock{guard_};
        ended_.wait(lock, [this] { return is_over_; });
    }

    void OnReadDone(bool is_good) override {
        if (!is_good) {
            return;
        }
        into_.take(number_, from_wire(message_));
        StartRead(&message_);
    }
    void OnDone(const ::grpc::Status& how) override {
        if (how.error_code() != ::grpc::StatusCode::CANCELLED) {
            into_.fail(std::make_exception_ptr(std::runtime_error("gRPC: a stream ended: " + how.error_message())));
        }
        const std::lock_guard lock{guard_};
        is_over_ = true;
        ended_.notify_one();
    }

  private:
    std::size_t number_;
    inbox& into_;
    wire::Car::Stub stub_;
    ::grpc::ClientContext context_;
    wire::Nothing nothing_;
    wire::Publication message_;
    std::mutex guard_;
    std::condition_variable ended_;
    bool is_over_ = false;
};

class grpc_subscriptions final : public subscriptions {
  public:
    grpc_subscriptions(const std::string& where, std::size_t count, inbox& into) {
        for (std::size_t i = 0; i < count; ++i) {
            all_.push_back(std::make_unique<subscription>(where, i, into));
        }
    }

  private:
    std::vector<std::unique_ptr<subscription>> all_;
};

} // namespace

class grpc_publisher::service final : public wire::Car::CallbackService {
  public:
    explicit service(const std::string& listen) {
        ::grpc::ServerBuilder builder;
        builder.RegisterService(this);
        server_ = start_grpc(builder, listen, where_);
    }
    service(const service&) = delete;
    service& operator=(const service&) = delete;
    ~service() override { server_->Shutdown(std::chrono::system_clock::now()); }

    ::grpc::ServerWriteReactor<wire::Publication>* Bind(::grpc::CallbackServerContext*, const wire::Nothing*) override {
        const std::lock_guard lock{guard_};
        streams_.push_back(std::make_unique<stream>());
        return streams_.back().get();
    }

    [[nodiscard]] const std::string& where() const noexcept { return where_; }
    void publish(const wire::Publication& message) {
        const std::lock_guard lock{guard_};
        for (auto& each : streams_) {
            each->send(message);
        }
    }

  private:
    std::mutex guard_;
    std::vector<std::unique_ptr<stream>> streams_;
    std::string where_;
    std::unique_ptr<::grpc::Server> server_;
};

grpc_publisher::grpc_publisher(const std::string& listen) : service_(std::make_unique<service>(listen)) {}
grpc_publisher::~grpc_publisher() = default;
const std::string& grpc_publisher::where() const noexcept { return service_->where(); }
void grpc_publisher::publish(const publication& value) { service_->publish(to_wire(value)); }

std::unique_ptr<subscriptions> make_grpc_subscriptions(const std::string& where, std::size_t count, inbox& into) {
    return std::make_unique<grpc_subscriptions>(where, count, into);
}

} // namespace cles::perf::peers
