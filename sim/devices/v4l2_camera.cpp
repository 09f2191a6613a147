// A camera behind the kernel's V4L2 interface, for programs that are started with this library preloaded.
//
// Device files lie below $V4L2_CAMERAS. A file that is removed is a cable that is pulled.
//
// - An ordinary file: its content is what the camera sends, at the rate that was asked for. In GREY, the first eight bytes
//   of every frame are its timestamp in microseconds.
// - A socket (SOCK_SEQPACKET): each message is a frame, behind its timestamp in microseconds (int64).
// Source: Linux kernel, Userspace API, Video for Linux (linux/videodev2.h).
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/timerfd.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace {

constexpr uint32_t kBufferBytes = 4 << 20;
constexpr int64_t kTransportUs = 20000;  // from the start of the exposure until the frame has arrived

struct Camera {
  std::string path;
  bool sends_itself = false;
  uint32_t width = 640, height = 480, format = V4L2_PIX_FMT_YUYV, frames = 30, sequence = 0;
  std::map<uint32_t, int> controls{
      {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY}, {V4L2_CID_EXPOSURE_ABSOLUTE, 156}, {V4L2_CID_GAIN, 10}};
  std::vector<char*> buffers;
  std::deque<uint32_t> queued;
};

std::mutex mutex;
std::map<int, Camera> cameras;

template <typename F>
F real(const char* name) {
  return reinterpret_cast<F>(dlsym(RTLD_NEXT, name));
}

Camera* find(int fd) {
  auto found = cameras.find(fd);
  return found == cameras.end() ? nullptr : &found->second;
}

int fail(int why) {
  errno = why;
  return -1;
}

void run(int fd, const Camera& camera, uint32_t frames) {
  if (camera.sends_itself) return;
  itimerspec period{};
  if (frames) period.it_interval.tv_nsec = period.it_value.tv_nsec = 1000000000 / frames;
  timerfd_settime(fd, 0, &period, nullptr);
}

void describe(const Camera& camera, v4l2_format* format) {
  v4l2_pix_format& pix = format->fmt.pix;
  pix.width = camera.width;
  pix.height = camera.height;
  pix.pixelformat = camera.format;
  pix.field = V4L2_FIELD_NONE;
  pix.bytesperline = camera.format == V4L2_PIX_FMT_MJPEG ? 0 : camera.width * (camera.format == V4L2_PIX_FMT_GREY ? 1 : 2);
  pix.sizeimage = camera.format == V4L2_PIX_FMT_MJPEG ? kBufferBytes : pix.bytesperline * camera.height;
  pix.colorspace = V4L2_COLORSPACE_SRGB;
}

void choose(Camera& camera, const v4l2_format& asked) {
  const uint32_t format = asked.fmt.pix.pixelformat;
  if (format == V4L2_PIX_FMT_MJPEG || format == V4L2_PIX_FMT_GREY || format == V4L2_PIX_FMT_YUYV) camera.format = format;
  const bool large = asked.fmt.pix.width > 640;  // it knows two sizes
  camera.width = large ? 1280 : 640;
  camera.height = large ? 720 : 480;
}

// The size of the frame that was read into `data`, or -1.
ssize_t read_file(int fd, const Camera& camera, char* data, int64_t* at_us) {
  uint64_t expired;
  if (read(fd, &expired, sizeof expired) != sizeof expired) return fail(EAGAIN);
  const int file = real<int (*)(const char*, int, ...)>("open")(camera.path.c_str(), O_RDONLY);
  if (file < 0) return fail(ENODEV);
  const ssize_t size = read(file, data, kBufferBytes);
  real<int (*)(int)>("close")(file);
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  *at_us = now.tv_sec * 1000000LL + now.tv_nsec / 1000 - kTransportUs;
  return size;
}

ssize_t read_socket(int fd, char* data, int64_t* at_us) {
  iovec parts[] = {{at_us, sizeof *at_us}, {data, kBufferBytes}};
  const ssize_t size = readv(fd, parts, 2);
  if (size < 0 && errno == EAGAIN) return -1;
  if (size < static_cast<ssize_t>(sizeof *at_us)) return fail(ENODEV);
  return size - sizeof *at_us;
}

int take(int fd, Camera& camera, v4l2_buffer* buffer) {
  if (camera.queued.empty()) return fail(EAGAIN);
  char* data = camera.buffers[camera.queued.front()];
  int64_t at_us;
  const ssize_t size = camera.sends_itself ? read_socket(fd, data, &at_us) : read_file(fd, camera, data, &at_us);
  if (size < 0) return -1;
  buffer->index = camera.queued.front();
  camera.queued.pop_front();
  buffer->bytesused = static_cast<uint32_t>(size);
  buffer->timestamp.tv_sec = at_us / 1000000;
  buffer->timestamp.tv_usec = at_us % 1000000;
  buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  buffer->sequence = camera.sequence++;
  buffer->length = kBufferBytes;
  if (camera.format == V4L2_PIX_FMT_GREY) memcpy(data, &at_us, sizeof at_us);
  return 0;
}

int answer(int fd, Camera& camera, unsigned long request, void* argument) {
  if (access(camera.path.c_str(), F_OK) != 0) return fail(ENODEV);
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto* capability = static_cast<v4l2_capability*>(argument);
      memset(capability, 0, sizeof *capability);
      strcpy(reinterpret_cast<char*>(capability->card), "camera of a test");
      capability->capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_DEVICE_CAPS;
      capability->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      return 0;
    }
    case VIDIOC_ENUMINPUT:
      return static_cast<v4l2_input*>(argument)->index == 0 ? 0 : fail(EINVAL);
    case VIDIOC_G_INPUT:
      *static_cast<int*>(argument) = 0;
      return 0;
    case VIDIOC_S_INPUT:
      return *static_cast<int*>(argument) == 0 ? 0 : fail(EINVAL);
    case VIDIOC_S_FMT:
      if (!camera.buffers.empty()) return fail(EBUSY);
      [[fallthrough]];
    case VIDIOC_TRY_FMT:
      choose(camera, *static_cast<v4l2_format*>(argument));
      [[fallthrough]];
    case VIDIOC_G_FMT:
      describe(camera, static_cast<v4l2_format*>(argument));
      return 0;
    case VIDIOC_S_PARM: {
      const v4l2_fract& asked = static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe;
      if (asked.numerator) {  // it knows three rates
        const uint32_t frames = asked.denominator / asked.numerator;
        camera.frames = frames >= 30 ? 30 : frames >= 15 ? 15 : 10;
      }
    }
      [[fallthrough]];
    case VIDIOC_G_PARM: {
      auto* parameters = static_cast<v4l2_streamparm*>(argument);
      parameters->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
      parameters->parm.capture.timeperframe = {1, camera.frames};
      return 0;
    }
    case VIDIOC_QUERYCTRL: {
      auto* query = static_cast<v4l2_queryctrl*>(argument);
      if (!camera.controls.count(query->id)) return fail(EINVAL);
      query->type = V4L2_CTRL_TYPE_INTEGER;
      query->minimum = 0;
      query->maximum = 10000;
      query->step = 1;
      query->flags = 0;
      return 0;
    }
    case VIDIOC_G_CTRL:
    case VIDIOC_S_CTRL: {
      auto* control = static_cast<v4l2_control*>(argument);
      auto found = camera.controls.find(control->id);
      if (found == camera.controls.end()) return fail(EINVAL);
      if (request == VIDIOC_S_CTRL && !getenv("V4L2_OWN_EXPOSURE")) found->second = control->value;
      control->value = found->second;
      return 0;
    }
    case VIDIOC_REQBUFS: {
      auto* wanted = static_cast<v4l2_requestbuffers*>(argument);
      camera.buffers.assign(wanted->count, nullptr);
      camera.queued.clear();
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      auto* buffer = static_cast<v4l2_buffer*>(argument);
      if (buffer->index >= camera.buffers.size()) return fail(EINVAL);
      buffer->length = kBufferBytes;
      buffer->m.offset = buffer->index * kBufferBytes;
      return 0;
    }
    case VIDIOC_QBUF:
      camera.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
      return 0;
    case VIDIOC_DQBUF:
      return take(fd, camera, static_cast<v4l2_buffer*>(argument));
    case VIDIOC_STREAMON:
      run(fd, camera, camera.frames);
      return 0;
    case VIDIOC_STREAMOFF:
      run(fd, camera, 0);
      camera.queued.clear();
      return 0;
    default:
      return fail(ENOTTY);
  }
}

int connect_to(const char* path) {
  const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  strncpy(address.sun_path, path, sizeof address.sun_path - 1);
  if (connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) return fd;
  real<int (*)(int)>("close")(fd);
  return -1;
}

int open_camera(const char* path) {
  const char* folder = getenv("V4L2_CAMERAS");
  struct stat info;
  if (!folder || strncmp(path, folder, strlen(folder)) != 0 || stat(path, &info) != 0) return -1;
  const bool is_socket = S_ISSOCK(info.st_mode);
  const int fd = is_socket ? connect_to(path) : timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK);
  if (fd < 0) return -1;
  std::lock_guard<std::mutex> lock(mutex);
  cameras[fd] = Camera{};
  cameras[fd].path = path;
  cameras[fd].sends_itself = is_socket;
  return fd;
}

void* map(void* address, size_t length, int protection, int flags, int fd, off_t offset, const char* name) {
  auto mapped = real<void* (*)(void*, size_t, int, int, int, off_t)>(name);
  std::lock_guard<std::mutex> lock(mutex);
  Camera* camera = fd < 0 ? nullptr : find(fd);
  if (!camera) return mapped(address, length, protection, flags, fd, offset);
  void* memory = mapped(nullptr, length, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  camera->buffers.at(offset / kBufferBytes) = static_cast<char*>(memory);
  return memory;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  const int camera = open_camera(path);
  if (camera >= 0) return camera;
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = va_arg(rest, mode_t);
  va_end(rest);
  return real<int (*)(const char*, int, ...)>("open")(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  const int camera = open_camera(path);
  if (camera >= 0) return camera;
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = va_arg(rest, mode_t);
  va_end(rest);
  return real<int (*)(const char*, int, ...)>("open64")(path, flags, mode);
}

int close(int fd) {
  {
    std::lock_guard<std::mutex> lock(mutex);
    cameras.erase(fd);
  }
  return real<int (*)(int)>("close")(fd);
}

int ioctl(int fd, unsigned long request, ...) {
  va_list rest;
  va_start(rest, request);
  void* argument = va_arg(rest, void*);
  va_end(rest);
  {
    std::lock_guard<std::mutex> lock(mutex);
    if (Camera* camera = find(fd)) return answer(fd, *camera, static_cast<uint32_t>(request), argument);
  }
  return real<int (*)(int, unsigned long, ...)>("ioctl")(fd, request, argument);
}

void* mmap(void* address, size_t length, int protection, int flags, int fd, off_t offset) {
  return map(address, length, protection, flags, fd, offset, "mmap");
}

void* mmap64(void* address, size_t length, int protection, int flags, int fd, off_t offset) {
  return map(address, length, protection, flags, fd, offset, "mmap64");
}

}  // extern "C"
