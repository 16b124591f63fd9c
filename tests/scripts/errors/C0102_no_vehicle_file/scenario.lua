-- exit: 2
vehicle "satelite.yaml"
