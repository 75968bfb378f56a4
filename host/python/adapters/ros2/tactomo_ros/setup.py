from setuptools import setup

setup(
    name="tactomo_ros",
    version="0.1.0",
    packages=["tactomo_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/tactomo_ros"]),
        ("share/tactomo_ros", ["package.xml"]),
        ("share/tactomo_ros/launch", ["launch/tactomo.launch.py"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    license="MIT OR Apache-2.0",
    entry_points={"console_scripts": ["touch = tactomo_ros.node:main"]},
)
