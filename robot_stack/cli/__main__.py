from robot_stack.cli import main

if __name__ == "__main__":
    main()
