"""Joints of the skeletons of many programs, and their names in the SMPL family."""

from __future__ import annotations

__all__ = ["TABLES"]

MIXAMO = """
mixamorig:Hips = pelvis
 mixamorig:Spine = spine1
  mixamorig:Spine1 = spine2
   mixamorig:Spine2 = spine3
    mixamorig:Neck = neck
     mixamorig:Head = head
      mixamorig:HeadTop_End = -
      mixamorig:LeftEye = left_eye
    mixamorig:LeftShoulder = left_collar
     mixamorig:LeftArm = left_shoulder
      mixamorig:LeftForeArm = left_elbow
       mixamorig:LeftHand = left_wrist
        mixamorig:LeftHandThumb1 = left_thumb1
         mixamorig:LeftHandThumb4 = -
        mixamorig:LeftHandMiddle3 = left_middle3
 mixamorig:RightUpLeg = right_hip
  mixamorig:RightLeg = right_knee
   mixamorig:RightFoot = right_ankle
    mixamorig:RightToeBase = right_foot
     mixamorig:RightToe_End = -
"""
HIK = """
Reference = -
 Hips = pelvis
  LeftUpLeg = left_hip
   LeftLeg = left_knee
    LeftFoot = left_ankle
     LeftToeBase = left_foot
  RightUpLeg = right_hip
  Spine = spine1
   Spine1 = -
    Spine2 = spine2
     Spine3 = -
      Spine4 = spine3
       Neck = neck
        Head = head
       LeftShoulder = left_collar
        LeftArm = left_shoulder
         LeftArmRoll = -
         LeftForeArm = left_elbow
          LeftHand = left_wrist
           LeftInHandIndex = -
            LeftHandIndex1 = left_index1
           LeftHandPinky2 = left_pinky2
"""
ROKOKO = """
Hips = pelvis
 LeftThigh = left_hip
  LeftShin = left_knee
   LeftFoot = left_ankle
    LeftToe = left_foot
 RightThigh = right_hip
 Spine1 = spine1
  Spine2 = spine2
   Spine3 = -
    Spine4 = spine3
     Neck = neck
      Head = head
     RightShoulder = right_collar
      RightArm = right_shoulder
       RightForeArm = right_elbow
        RightHand = right_wrist
"""
CMU = """
Hips = pelvis
 LHipJoint = -
  LeftUpLeg = left_hip
   LeftLeg = left_knee
    LeftFoot = left_ankle
     LeftToeBase = left_foot
 RHipJoint = -
  RightUpLeg = right_hip
 LowerBack = spine1
  Spine = spine2
   Spine1 = spine3
    Neck = neck
     Neck1 = -
      Head = head
    LeftShoulder = left_collar
     LeftArm = left_shoulder
      LeftForeArm = left_elbow
       LeftHand = left_wrist
        LeftFingerBase = -
         LeftHandIndex1 = left_index1
        LThumb = -
"""
CMU_ASF = """
root = pelvis
 lhipjoint = -
  lfemur = left_hip
   ltibia = left_knee
    lfoot = left_ankle
     ltoes = left_foot
 rhipjoint = -
  rfemur = right_hip
 lowerback = spine1
  upperback = spine2
   thorax = spine3
    lowerneck = neck
     upperneck = -
      head = head
    rclavicle = right_collar
     rhumerus = right_shoulder
      rradius = right_elbow
       rwrist = right_wrist
        rhand = right_hand
         rfingers = -
"""
RIGIFY = """
spine = pelvis
 spine.001 = spine1
  spine.002 = spine2
   spine.003 = spine3
    spine.004 = neck
     spine.005 = -
      spine.006 = head
    shoulder.L = left_collar
     upper_arm.L = left_shoulder
      forearm.L = left_elbow
       hand.L = left_wrist
        f_index.01.L = left_index1
         f_index.02.L = left_index2
        thumb.01.L = left_thumb1
        palm.01.L = -
    shoulder.R = right_collar
 thigh.L = left_hip
  shin.L = left_knee
   foot.L = left_ankle
    toe.L = left_foot
 thigh.R = right_hip
  thigh.R.001 = -
"""
MAYA_SMPL = """
m_avg_root = -
 m_avg_Pelvis = pelvis
  m_avg_L_Hip = left_hip
   m_avg_L_Knee = left_knee
    m_avg_L_Ankle = left_ankle
     m_avg_L_Foot = left_foot
  m_avg_R_Hip = right_hip
  m_avg_Spine1 = spine1
   m_avg_Spine2 = spine2
    m_avg_Spine3 = spine3
     m_avg_Neck = neck
      m_avg_Head = head
     m_avg_L_Collar = left_collar
      m_avg_L_Shoulder = left_shoulder
       m_avg_L_Elbow = left_elbow
        m_avg_L_Wrist = left_wrist
         m_avg_L_Hand = left_hand
"""
BIPED = """
Bip01 = -
 Bip01 Pelvis = pelvis
  Bip01 Spine = spine1
   Bip01 Spine1 = spine3
    Bip01 Neck = neck
     Bip01 Head = head
     Bip01 L Clavicle = left_collar
      Bip01 L UpperArm = left_shoulder
       Bip01 L Forearm = left_elbow
        Bip01 L Hand = left_wrist
         Bip01 L Finger0 = left_thumb1
          Bip01 L Finger01 = left_thumb2
         Bip01 L Finger1 = left_index1
          Bip01 L Finger12 = left_index3
         Bip01 L Finger4 = left_pinky1
   Bip01 R Thigh = right_hip
    Bip01 R Calf = right_knee
     Bip01 R Foot = right_ankle
      Bip01 R Toe0 = right_foot
"""
UNREAL = """
root = -
 pelvis = pelvis
  spine_01 = spine1
   spine_02 = spine2
    spine_03 = spine3
     clavicle_l = left_collar
      upperarm_l = left_shoulder
       lowerarm_l = left_elbow
        lowerarm_twist_01_l = -
        hand_l = left_wrist
         index_metacarpal_l = -
          index_01_l = left_index1
     neck_01 = neck
      head = head
  thigh_r = right_hip
   calf_r = right_knee
    foot_r = right_ankle
     ball_r = right_foot
"""
VRM = """
J_Bip_C_Hips = pelvis
 J_Bip_C_Spine = spine1
  J_Bip_C_Chest = spine2
   J_Bip_C_UpperChest = spine3
    J_Bip_L_Shoulder = left_collar
     J_Bip_L_UpperArm = left_shoulder
      J_Bip_L_LowerArm = left_elbow
       J_Bip_L_Hand = left_wrist
        J_Bip_L_Little1 = left_pinky1
 J_Bip_R_UpperLeg = right_hip
  J_Bip_R_LowerLeg = right_knee
 J_Sec_Hair1_01 = -
"""
MAKEHUMAN = """
root = pelvis
 spine05 = spine1
  spine04 = -
   spine03 = spine2
    spine02 = -
     spine01 = spine3
      clavicle.L = left_collar
       shoulder01.L = -
        upperarm01.L = left_shoulder
         upperarm02.L = -
          lowerarm01.L = left_elbow
           lowerarm02.L = -
            wrist.L = left_wrist
             metacarpal1.L = -
               finger2-2.L = left_index2
             finger1-1.L = left_thumb1
      neck01 = neck
       neck02 = -
        head = head
         jaw = jaw
 pelvis.L = -
  upperleg01.L = left_hip
 pelvis.R = -
  upperleg01.R = right_hip
   upperleg02.R = -
    lowerleg01.R = right_knee
     lowerleg02.R = -
      foot.R = right_ankle
       toe1-1.R = right_foot
"""
POSER = """
hip = pelvis
 abdomen = spine1
  chest = spine3
   neck = neck
    head = head
   lCollar = left_collar
    lShldr = left_shoulder
     lForeArm = left_elbow
      lHand = left_wrist
       lThumb1 = left_thumb1
       lMid2 = left_middle2
 rButtock = -
  rThigh = right_hip
   rShin = right_knee
    rFoot = right_ankle
"""
OLD_BVH = """
Hips = pelvis
 LeftHip = left_hip
  LeftKnee = left_knee
   LeftAnkle = left_ankle
 RightHip = right_hip
 Chest = spine1
  LeftCollar = left_collar
   LeftShoulder = left_shoulder
    LeftElbow = left_elbow
     LeftWrist = left_wrist
  Neck = neck
   Head = head
"""
XSENS = """
Pelvis = pelvis
 L5 = spine1
  L3 = spine2
   T12 = -
    T8 = spine3
     Neck = neck
      Head = head
     LeftShoulder = left_collar
      LeftUpperArm = left_shoulder
       LeftForeArm = left_elbow
        LeftHand = left_wrist
 RightUpperLeg = right_hip
  RightLowerLeg = right_knee
   RightFoot = right_ankle
    RightToe = right_foot
"""
DAZ = """
hip = pelvis
 lThighBend = left_hip
  lThighTwist = -
   lShin = left_knee
    lFoot = left_ankle
     lToe = left_foot
 abdomenLower = spine1
  chestUpper = spine3
   neckLower = neck
    head = head
   rCollar = right_collar
    rShldrBend = right_shoulder
     rShldrTwist = -
      rForearmBend = right_elbow
       rForearmTwist = -
        rHand = right_wrist
         rMid1 = right_middle1
"""
AUTO_RIG = """
root.x = pelvis
 spine_01.x = spine1
  spine_02.x = spine3
   neck.x = neck
    head.x = head
   shoulder.l = left_collar
    arm_stretch.l = left_shoulder
     forearm_stretch.l = left_elbow
      hand.l = left_wrist
       index1.l = left_index1
 thigh_stretch.r = right_hip
  leg_stretch.r = right_knee
   foot.r = right_ankle
    toes_01.r = right_foot
"""
CATS = """
Hips = pelvis
 Spine = spine1
  Chest = spine3
   Neck = neck
    Head = head
   Left shoulder = left_collar
    Left arm = left_shoulder
     Left elbow = left_elbow
      Left wrist = left_wrist
 Left leg = left_hip
  Left knee = left_knee
   Left ankle = left_ankle
    Left toe = left_foot
"""


def numbered(table: str) -> str:
    """Return a table whose names end in the index of the joint, as programs write unique names."""
    lines = table.strip("\n").split("\n")
    ended = [line.replace(" =", f"_{index:03} =") for index, line in enumerate(lines)]
    return "\n".join(["", *ended, ""])


TABLES = {
    "mixamo with unique numbers": numbered(MIXAMO),
    "biped with unique numbers": numbered(BIPED),
    "daz": DAZ,
    "auto-rig pro": AUTO_RIG,
    "cats": CATS,
    "mixamo": MIXAMO,
    "mixamo underscores": MIXAMO.replace("mixamorig:", "mixamorig_"),
    "mixamo numbered": MIXAMO.replace("mixamorig:", "mixamorig12:"),
    "motionbuilder": HIK,
    "motionbuilder prefixed": HIK.replace("\n", "\nY")
    .replace("Y ", " Y")
    .replace("Y", "Character1_"),
    "rokoko": ROKOKO,
    "cmu": CMU,
    "cmu asf": CMU_ASF,
    "rigify": RIGIFY,
    "smpl from maya": MAYA_SMPL,
    "smpl from maya, female": MAYA_SMPL.replace("m_avg", "f_avg"),
    "biped": BIPED,
    "biped underscores": BIPED.replace("Bip01 ", "Bip001_").replace("Bip001_=", "Bip001 ="),
    "unreal": UNREAL,
    "vrm": VRM,
    "makehuman": MAKEHUMAN,
    "poser": POSER,
    "old bvh": OLD_BVH,
    "xsens": XSENS,
}
