"""What the localization node needs beside its kernels."""
