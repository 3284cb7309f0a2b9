"""Joints of the skeletons of many programs, and their names in the SMPL family."""

import re
from collections.abc import Callable

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
QUATERNIUS = """
Root = pelvis
 Belly = -
 Hips = spine1
  Abdomen = spine2
   Torso = spine3
    Neck = neck
     Head = head
      Ear1.L = -
    Shoulder.L = left_collar
     UpperArm.L = left_shoulder
      LowerArm.L = left_elbow
       Fist.L = left_wrist
    Shoulder.R = right_collar
     UpperArm.R = right_shoulder
      LowerArm.R = right_elbow
       Fist.R = right_wrist
 UpperLeg.L = left_hip
  LowerLeg.L = left_knee
   Foot.L = left_ankle
 UpperLeg.R = right_hip
  LowerLeg.R = right_knee
   Foot.R = right_ankle
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
GERMAN = """
Becken = pelvis
 Wirbelsäule1 = spine1
  Wirbelsäule2 = spine2
   Brust = spine3
    Hals = neck
     Kopf = head
    Schulter.links = left_collar
     Oberarm.links = left_shoulder
      Unterarm.links = left_elbow
       Hand.links = left_wrist
        Daumen1.links = left_thumb1
        Zeigefinger1.links = left_index1
    Schulter.rechts = right_collar
     Oberarm.rechts = right_shoulder
 Oberschenkel.links = left_hip
  Unterschenkel.links = left_knee
   Fuß.links = left_ankle
    Zehen.links = left_foot
 Oberschenkel.rechts = right_hip
"""
JAPANESE = """
腰 = pelvis
 背骨 = spine1
  胸 = spine3
   首 = neck
    頭 = head
   左鎖骨 = left_collar
    左上腕 = left_shoulder
     左前腕 = left_elbow
      左手 = left_wrist
 左太もも = left_hip
  左すね = left_knee
   左足 = left_ankle
    左つま先 = left_foot
 右太もも = right_hip
"""
FRENCH = """
Bassin = pelvis
 Colonne1 = spine1
  Poitrine = spine3
   Cou = neck
    Tête = head
   Clavicule_G = left_collar
    Bras_G = left_shoulder
     AvantBras_G = left_elbow
      Main_G = left_wrist
       Pouce1_G = left_thumb1
       Index1_G = left_index1
   Clavicule_D = right_collar
    Bras_D = right_shoulder
     AvantBras_D = right_elbow
      Main_D = right_wrist
       Pouce1_D = right_thumb1
       Index1_D = right_index1
 Cuisse_G = left_hip
  Tibia_G = left_knee
   Pied_G = left_ankle
    Orteils_G = left_foot
 Cuisse_D = right_hip
  Tibia_D = right_knee
   Pied_D = right_ankle
    Orteils_D = right_foot
"""
FRENCH_JOINTS = """
hanches = pelvis
 colonne = spine1
  torse = spine3
   cou = neck
    tete = head
   clavicule gauche = left_collar
    epaule gauche = left_shoulder
     coude gauche = left_elbow
      poignet gauche = left_wrist
       pouce1 gauche = left_thumb1
       index1 gauche = left_index1
   clavicule droite = right_collar
    epaule droite = right_shoulder
     coude droite = right_elbow
      poignet droite = right_wrist
       pouce1 droite = right_thumb1
       index1 droite = right_index1
 hanche gauche = left_hip
  genou gauche = left_knee
   cheville gauche = left_ankle
    pied gauche = left_foot
 hanche droite = right_hip
  genou droite = right_knee
   cheville droite = right_ankle
    pied droite = right_foot
"""
SPANISH = """
Cadera = pelvis
 Columna1 = spine1
  Pecho = spine3
   Cuello = neck
    Cabeza = head
   Hombro.Izq = left_collar
    Brazo.Izq = left_shoulder
     Antebrazo.Izq = left_elbow
      Mano.Izq = left_wrist
       Pulgar1.Izq = left_thumb1
       Indice1.Izq = left_index1
   Hombro.Der = right_collar
    Brazo.Der = right_shoulder
     Antebrazo.Der = right_elbow
      Mano.Der = right_wrist
       Pulgar1.Der = right_thumb1
       Indice1.Der = right_index1
 Muslo.Izq = left_hip
  Pierna.Izq = left_knee
   Pie.Izq = left_ankle
    Dedos.Izq = left_foot
 Muslo.Der = right_hip
  Pierna.Der = right_knee
   Pie.Der = right_ankle
    Dedos.Der = right_foot
"""
SPANISH_JOINTS = """
pelvis = pelvis
 espalda = spine1
  torso = spine3
   cuello = neck
    cabeza = head
   clavicula_izquierda = left_collar
    hombro_izquierda = left_shoulder
     codo_izquierda = left_elbow
      muneca_izquierda = left_wrist
       pulgar1_izquierda = left_thumb1
       índice1_izquierda = left_index1
   clavicula_derecha = right_collar
    hombro_derecha = right_shoulder
     codo_derecha = right_elbow
      muneca_derecha = right_wrist
       pulgar1_derecha = right_thumb1
       índice1_derecha = right_index1
 cadera_izquierda = left_hip
  rodilla_izquierda = left_knee
   tobillo_izquierda = left_ankle
    pie_izquierda = left_foot
 cadera_derecha = right_hip
  rodilla_derecha = right_knee
   tobillo_derecha = right_ankle
    pie_derecha = right_foot
"""
ITALIAN = """
Bacino = pelvis
 Spina1 = spine1
  Petto = spine3
   Collo = neck
    Testa = head
   Spalla_SX = left_collar
    Braccio_SX = left_shoulder
     Avambraccio_SX = left_elbow
      Mano_SX = left_wrist
       Pollice1_SX = left_thumb1
       Indice1_SX = left_index1
   Spalla_DX = right_collar
    Braccio_DX = right_shoulder
     Avambraccio_DX = right_elbow
      Mano_DX = right_wrist
       Pollice1_DX = right_thumb1
       Indice1_DX = right_index1
 Coscia_SX = left_hip
  Gamba_SX = left_knee
   Piede_SX = left_ankle
    Dita_SX = left_foot
 Coscia_DX = right_hip
  Gamba_DX = right_knee
   Piede_DX = right_ankle
    Dita_DX = right_foot
"""
PORTUGUESE = """
Quadril = pelvis
 Coluna1 = spine1
  Peito = spine3
   Pescoço = neck
    Cabeça = head
   Ombro_E = left_collar
    Braço_E = left_shoulder
     Antebraço_E = left_elbow
      Mão_E = left_wrist
       Polegar1_E = left_thumb1
       Indicador1_E = left_index1
   Ombro_D = right_collar
    Braço_D = right_shoulder
     Antebraço_D = right_elbow
      Mão_D = right_wrist
       Polegar1_D = right_thumb1
       Indicador1_D = right_index1
 Coxa_E = left_hip
  Perna_E = left_knee
   Pé_E = left_ankle
    Dedos_E = left_foot
 Coxa_D = right_hip
  Perna_D = right_knee
   Pé_D = right_ankle
    Dedos_D = right_foot
"""
CHINESE = """
骨盆 = pelvis
 脊柱1 = spine1
  胸部 = spine3
   脖子 = neck
    头 = head
   左锁骨 = left_collar
    左上臂 = left_shoulder
     左前臂 = left_elbow
      左手 = left_wrist
       左拇指1 = left_thumb1
       左食指1 = left_index1
   右锁骨 = right_collar
    右上臂 = right_shoulder
     右前臂 = right_elbow
      右手 = right_wrist
       右拇指1 = right_thumb1
       右食指1 = right_index1
 左大腿 = left_hip
  左小腿 = left_knee
   左脚 = left_ankle
    左脚趾 = left_foot
 右大腿 = right_hip
  右小腿 = right_knee
   右脚 = right_ankle
    右脚趾 = right_foot
"""
CHINESE_LATIN = """
gupen = pelvis
 jizhu1 = spine1
  xiong = spine3
   bozi = neck
    tou = head
   zuo_jian = left_collar
    zuo_dabi = left_shoulder
     zuo_xiaobi = left_elbow
      zuo_shou = left_wrist
       zuo_muzhi1 = left_thumb1
       zuo_shizhi1 = left_index1
   you_jian = right_collar
    you_dabi = right_shoulder
     you_xiaobi = right_elbow
      you_shou = right_wrist
       you_muzhi1 = right_thumb1
       you_shizhi1 = right_index1
 zuo_datui = left_hip
  zuo_xiaotui = left_knee
   zuo_jiao = left_ankle
    zuo_jiaozhi = left_foot
 you_datui = right_hip
  you_xiaotui = right_knee
   you_jiao = right_ankle
    you_jiaozhi = right_foot
"""
PATCHES = """
Hips = pelvis
 Spine = spine1
  LeftArm = left_shoulder
   LeftForeArm = left_elbow
    LeftElbowPad = -
 LeftUpLeg = left_hip
  LeftLeg = left_knee
   LeftKneePatch = -
 RightUpLeg = right_hip
  RightLeg = right_knee
   RightKneePatch = -
   RightShoe = right_ankle
"""
PAWS = """
Hips = pelvis
 Spine = spine1
  Neck = neck
   Head = head
  LeftArm = left_shoulder
   LeftForeArm = left_elbow
    LeftForeArmTwist = -
    LeftPaw = left_wrist
     LeftClaw = -
 LeftUpLeg = left_hip
  LeftLeg = left_knee
   LeftHindPaw = left_ankle
    LeftHindClaw = left_foot
 RightUpLeg = right_hip
  RightLeg = right_knee
   RightLegTwist = -
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


SOMA = """
Root = -
 Hips = pelvis
  Spine1 = spine1
   Spine2 = spine2
    Chest = spine3
     Neck1 = neck
      Neck2 = -
       Head = head
        HeadEnd = -
        Jaw = jaw
        LeftEye = left_eye
     LeftShoulder = left_collar
      LeftArm = left_shoulder
       LeftForeArm = left_elbow
        LeftHand = left_wrist
         LeftHandThumb1 = left_thumb1
          LeftHandThumb2 = left_thumb2
           LeftHandThumb3 = left_thumb3
            LeftHandThumbEnd = -
         LeftHandIndex1 = -
          LeftHandIndex2 = left_index1
           LeftHandIndex3 = left_index2
            LeftHandIndex4 = left_index3
             LeftHandIndexEnd = -
  LeftLeg = left_hip
   LeftShin = left_knee
    LeftFoot = left_ankle
     LeftToeBase = left_foot
      LeftToeEnd = -
  RightLeg = right_hip
   RightShin = right_knee
"""
MAKEHUMAN_BVH = """
Root = pelvis
 Spine1 = spine1
  Spine2 = spine2
   Spine3 = spine3
    Neck = neck
     Head = head
      __Jaw = -
       Jaw = jaw
      __Eye_L = -
       Eye_L = left_eye
    __Clavicle_L = -
     Clavicle_L = left_collar
      UpArm_L = left_shoulder
       LoArm_L = left_elbow
        Hand_L = left_wrist
         __Thumb1_L = -
          Thumb1_L = left_thumb1
           Thumb2_L = left_thumb2
         Middle1_L = left_middle1
 __UpLeg_L = -
  UpLeg_L = left_hip
   LoLeg_L = left_knee
    Foot_L = left_ankle
     Toe_L = left_foot
 __UpLeg_R = -
  UpLeg_R = right_hip
   LoLeg_R = right_knee
"""
MMD = """
全ての親 = -
 センター = -
  グルーブ = -
   腰 = -
    上半身 = spine1
     上半身2 = spine3
      首 = neck
       頭 = head
        左目 = left_eye
        両目 = -
      左肩P = -
       左肩 = left_collar
        左肩C = -
         左腕 = left_shoulder
          左腕捩 = -
           左ひじ = left_elbow
            左手捩 = -
             左手首 = left_wrist
              左親指０ = left_thumb1
               左親指１ = left_thumb2
                左親指２ = left_thumb3
              左人指１ = left_index1
               左人指２ = left_index2
              左中指３ = left_middle3
              左薬指１ = left_ring1
              左小指２ = left_pinky2
    下半身 = pelvis
     左足 = left_hip
      左ひざ = left_knee
       左足首 = left_ankle
        左つま先 = left_foot
     左足D = -
     右足 = right_hip
      右ひざ = right_knee
 左足ＩＫ = -
  左つま先ＩＫ = -
"""
MMD_LATIN = """
sentaa = -
 jouhanshin = spine1
  jouhanshin2 = spine3
   kubi = neck
    atama = head
   kata_L = left_collar
    ude_L = left_shoulder
     hiji_L = left_elbow
      tekubi_L = left_wrist
       oyayubi0_L = left_thumb1
        oyayubi1_L = left_thumb2
         oyayubi2_L = left_thumb3
 kahanshin = pelvis
  hidari ashi = left_hip
   hidari hiza = left_knee
    hidari ashikubi = left_ankle
     hidari tsumasaki = left_foot
  migi ashi = right_hip
"""
MMD_ENGLISH = """
mother = -
 center = -
  groove = -
   waist = -
    upper body = spine1
     upper body 2 = spine3
      neck = neck
       head = head
      shoulder_L = left_collar
       arm_L = left_shoulder
        elbow_L = left_elbow
         wrist_L = left_wrist
          thumb0_L = left_thumb1
           thumb1_L = left_thumb2
            thumb2_L = left_thumb3
          fore1_L = left_index1
          third2_L = left_ring2
    lower body = pelvis
     leg_L = left_hip
      knee_L = left_knee
       ankle_L = left_ankle
        toe_L = left_foot
     leg_R = right_hip
leg IK_L = -
"""
KINECT = """
SpineBase = pelvis
 SpineMid = spine1
  SpineShoulder = spine3
   Neck = neck
    Head = head
   ShoulderLeft = left_shoulder
    ElbowLeft = left_elbow
     WristLeft = left_wrist
      HandLeft = left_hand
       HandTipLeft = -
 HipLeft = left_hip
  KneeLeft = left_knee
   AnkleLeft = left_ankle
    FootLeft = left_foot
 HipRight = right_hip
"""
AZURE_KINECT = """
PELVIS = pelvis
 SPINE_NAVEL = spine1
  SPINE_CHEST = spine3
   NECK = neck
    HEAD = head
   CLAVICLE_LEFT = left_collar
    SHOULDER_LEFT = left_shoulder
     ELBOW_LEFT = left_elbow
      WRIST_LEFT = left_wrist
       HAND_LEFT = left_hand
 HIP_RIGHT = right_hip
  KNEE_RIGHT = right_knee
   ANKLE_RIGHT = right_ankle
    FOOT_RIGHT = right_foot
"""
OPTITRACK = """
Hip = pelvis
 Ab = spine1
  Chest = spine3
   Neck = neck
    Head = head
   LShoulder = left_collar
    LUArm = left_shoulder
     LFArm = left_elbow
      LHand = left_wrist
       LThumb1 = left_thumb1
 LThigh = left_hip
  LShin = left_knee
   LFoot = left_ankle
    LToe = left_foot
 RThigh = right_hip
"""
CHARACTER_CREATOR = """
CC_Base_BoneRoot = -
 CC_Base_Hip = pelvis
  CC_Base_Pelvis = -
   CC_Base_L_Thigh = left_hip
    CC_Base_L_ThighTwist01 = -
    CC_Base_L_Calf = left_knee
     CC_Base_L_Foot = left_ankle
      CC_Base_L_ToeBase = left_foot
       CC_Base_L_BigToe1 = -
   CC_Base_R_Thigh = right_hip
  CC_Base_Waist = spine1
   CC_Base_Spine01 = spine2
    CC_Base_Spine02 = spine3
     CC_Base_NeckTwist01 = neck
      CC_Base_NeckTwist02 = -
       CC_Base_Head = head
     CC_Base_L_Clavicle = left_collar
      CC_Base_L_Upperarm = left_shoulder
       CC_Base_L_UpperarmTwist01 = -
       CC_Base_L_Forearm = left_elbow
        CC_Base_L_Hand = left_wrist
         CC_Base_L_Thumb1 = left_thumb1
         CC_Base_L_Mid2 = left_middle2
"""
SECOND_LIFE = """
mPelvis = pelvis
 mTorso = spine1
  mChest = spine3
   mNeck = neck
    mHead = head
   mCollarLeft = left_collar
    mShoulderLeft = left_shoulder
     mElbowLeft = left_elbow
      mWristLeft = left_wrist
       mHandIndex1Left = left_index1
 mHipLeft = left_hip
  mKneeLeft = left_knee
   mAnkleLeft = left_ankle
    mFootLeft = left_foot
     mToeLeft = -
 mHipRight = right_hip
"""
XNALARA = """
root hips = -
 pelvis = pelvis
  leg left thigh = left_hip
   leg left knee = left_knee
    leg left ankle = left_ankle
     leg left toes = left_foot
  leg right thigh = right_hip
 spine lower = -
  arm left shoulder 1 = left_collar
   arm left shoulder 2 = left_shoulder
    arm left elbow = left_elbow
     arm left wrist = left_wrist
"""
ARKIT = """
root = -
 hips_joint = pelvis
  left_upLeg_joint = left_hip
   left_leg_joint = left_knee
    left_foot_joint = left_ankle
     left_toes_joint = left_foot
      left_toesEnd_joint = -
  right_upLeg_joint = right_hip
  spine_1_joint = spine1
   spine_2_joint = -
    spine_3_joint = -
     spine_4_joint = spine2
      spine_5_joint = -
       spine_6_joint = -
        spine_7_joint = spine3
         left_shoulder_1_joint = left_collar
          left_arm_joint = left_shoulder
           left_forearm_joint = left_elbow
            left_hand_joint = left_wrist
             left_handIndexStart_joint = -
              left_handIndex_1_joint = left_index1
         neck_1_joint = neck
          head_joint = head
"""
ROBLOX = """
HumanoidRootPart = -
 LowerTorso = pelvis
  UpperTorso = spine1
   Head = head
   LeftUpperArm = left_shoulder
    LeftLowerArm = left_elbow
     LeftHand = left_wrist
  LeftUpperLeg = left_hip
   LeftLowerLeg = left_knee
    LeftFoot = left_ankle
  RightUpperLeg = right_hip
"""
MUJOCO_SMPL = """
Pelvis = pelvis
 L_Hip = left_hip
  L_Knee = left_knee
   L_Ankle = left_ankle
    L_Toe = left_foot
 R_Hip = right_hip
 Torso = spine1
  Spine = spine2
   Chest = spine3
    Neck = neck
     Head = head
    L_Thorax = left_collar
     L_Shoulder = left_shoulder
      L_Elbow = left_elbow
       L_Wrist = left_wrist
        L_Hand = left_hand
"""
MHR = """
body_world = -
 root = pelvis
  l_upleg = left_hip
   l_upleg_twist0_proc = -
   l_lowleg = left_knee
    l_foot = left_ankle
     l_talocrural = -
      l_ball = left_foot
  r_upleg = right_hip
  c_spine0 = spine1
   c_spine1 = spine2
    c_spine2 = -
     c_spine3 = spine3
      l_clavicle = left_collar
       l_uparm = left_shoulder
        l_lowarm = left_elbow
         l_wrist = left_wrist
          l_pinky0 = -
           l_pinky1 = left_pinky1
          l_thumb0 = -
           l_thumb1 = left_thumb1
            l_thumb2 = left_thumb2
             l_thumb3 = left_thumb3
      c_neck = neck
       c_head = head
        c_jaw = jaw
"""
VALVE = """
ValveBiped.Bip01_Pelvis = pelvis
 ValveBiped.Bip01_L_Thigh = left_hip
  ValveBiped.Bip01_L_Calf = left_knee
   ValveBiped.Bip01_L_Foot = left_ankle
    ValveBiped.Bip01_L_Toe0 = left_foot
 ValveBiped.Bip01_R_Thigh = right_hip
 ValveBiped.Bip01_Spine = spine1
  ValveBiped.Bip01_Spine1 = spine2
   ValveBiped.Bip01_Spine2 = -
    ValveBiped.Bip01_Spine4 = spine3
     ValveBiped.Bip01_Neck1 = neck
      ValveBiped.Bip01_Head1 = head
     ValveBiped.Bip01_L_Clavicle = left_collar
      ValveBiped.Bip01_L_UpperArm = left_shoulder
       ValveBiped.Bip01_L_Forearm = left_elbow
        ValveBiped.Bip01_L_Hand = left_wrist
         ValveBiped.Bip01_L_Finger0 = left_thumb1
         ValveBiped.Bip01_L_Finger12 = left_index3
"""
ROKOKO_GLOVES = """
Hips = pelvis
 Spine1 = spine1
  LeftShoulder = left_collar
   LeftArm = left_shoulder
    LeftForeArm = left_elbow
     LeftHand = left_wrist
      LeftFinger1Metacarpal = left_thumb1
       LeftFinger1Proximal = left_thumb2
        LeftFinger1Distal = left_thumb3
         LeftFinger1Tip = -
      LeftFinger2Metacarpal = -
       LeftFinger2Proximal = left_index1
        LeftFinger2Medial = left_index2
         LeftFinger2Distal = left_index3
      LeftFinger5Proximal = left_pinky1
 LeftThigh = left_hip
  LeftShin = left_knee
 RightThigh = right_hip
"""
HIP_HELPERS = """
Hips = pelvis
 LeftHip = -
  LeftUpLeg = left_hip
   LeftLeg = left_knee
    LeftFoot = left_ankle
 RightHip = -
  RightUpLeg = right_hip
   RightLeg = right_knee
 Spine = spine1
  LeftShoulder = left_shoulder
   LeftElbow = left_elbow
    LeftHand = left_wrist
"""
WRIST_AND_HAND = """
Hips = pelvis
 LeftLeg = left_hip
  LeftFoot = left_ankle
 RightLeg = right_hip
 Spine = spine1
  LeftCollar = left_collar
   LeftShoulder = -
    LeftArm = left_shoulder
     LeftForeArm = left_elbow
      LeftWrist = left_wrist
       LeftHand = left_hand
"""


KAYKIT = """
root = -
 hips = pelvis
  spine = spine1
   chest = spine3
    head = head
    upperarm.l = left_shoulder
     lowerarm.l = left_elbow
      wrist.l = left_wrist
       hand.l = left_hand
        handslot.l = -
  upperleg.r = right_hip
   lowerleg.r = right_knee
    foot.r = right_ankle
     toes.r = right_foot
 kneeIK.l = -
"""
DAZ_9 = """
hip = pelvis
 pelvis = -
  l_thigh = left_hip
   l_thightwist1 = -
   l_shin = left_knee
    l_foot = left_ankle
     l_toes = left_foot
  r_thigh = right_hip
 spine1 = spine1
  spine2 = spine2
   spine3 = -
    spine4 = spine3
     neck1 = neck
      neck2 = -
       head = head
     r_shoulder = right_collar
      r_upperarm = right_shoulder
       r_forearm = right_elbow
        r_hand = right_wrist
         r_thumb1 = right_thumb1
         r_metacarpal_index = -
          r_index1 = right_index1
"""
ARM_AND_LEG_LAST = """
Hips = pelvis
 Thigh.L = left_hip
  Leg.L = left_knee
   Foot.L = left_ankle
 Thigh.R = right_hip
 Spine = spine1
  Shoulder.L = left_collar
   UpperArm.L = left_shoulder
    Arm.L = left_elbow
     Hand.L = left_wrist
"""
OPENSIM = """
pelvis = pelvis
 femur_r = right_hip
  tibia_r = right_knee
   talus_r = right_ankle
    calcn_r = -
     toes_r = right_foot
 femur_l = left_hip
 torso = spine1
  humerus_r = right_shoulder
   ulna_r = right_elbow
    radius_r = -
     hand_r = right_wrist
"""
UPPER_LAST = """
Hips = pelvis
 Leg_Upper_L = left_hip
  Leg_Lower_L = left_knee
   Foot_L = left_ankle
 Leg_Upper_R = right_hip
 Spine = spine1
  Shoulder_L = left_collar
   Arm_Upper_L = left_shoulder
    Arm_Lower_L = left_elbow
     Hand_L = left_wrist
"""


def changed(table: str, change: Callable[[str], str]) -> str:
    """Return a table with other names for the same joints."""
    lines = []
    for line in table.strip("\n").split("\n"):
        name, _, meaning = line.strip().partition(" = ")
        lines.append(f"{line[: len(line) - len(line.lstrip())]}{change(name)} = {meaning}")
    return "\n".join(["", *lines, ""])


def shift_jis(name: str) -> str:
    """Return a name as the reader returns it from a file in Shift JIS."""
    return name.encode("cp932").decode("utf-8", "surrogateescape")


def dotted(name: str) -> str:
    """Return a name as Blender writes sides: UpArm_L becomes UpArm.L, LeftLeg becomes Leg.L."""
    for side in ("Left", "Right", "左", "右"):
        if name.startswith(side):
            return f"{name.removeprefix(side).strip()}.{'L' if side in ('Left', '左') else 'R'}"
    return name


def numbered(table: str) -> str:
    """Return a table whose names end in the index of the joint, as programs write unique names."""
    lines = table.strip("\n").split("\n")
    ended = [line.replace(" =", f"_{index:03} =") for index, line in enumerate(lines)]
    return "\n".join(["", *ended, ""])


ADVANCED_SKELETON = """
Root_M = pelvis
 Hip_R = right_hip
  HipPart1_R = -
   Knee_R = right_knee
    Ankle_R = right_ankle
     Toes_R = right_foot
      ToesEnd_R = -
 Hip_L = left_hip
  Knee_L = left_knee
   Ankle_L = left_ankle
    Toes_L = left_foot
 Spine1_M = spine1
  Spine2_M = spine2
   Chest_M = spine3
    Scapula_R = right_collar
     Shoulder_R = right_shoulder
      ShoulderPart1_R = -
       Elbow_R = right_elbow
        Wrist_R = right_wrist
         IndexFinger1_R = right_index1
         Cup_R = -
          PinkyFinger1_R = right_pinky1
    Scapula_L = left_collar
     Shoulder_L = left_shoulder
      Elbow_L = left_elbow
       Wrist_L = left_wrist
    Neck_M = neck
     Head_M = head
      Jaw_M = jaw
      Eye_R = right_eye
"""
TABLES = {
    "advanced skeleton": ADVANCED_SKELETON,
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
    "soma": SOMA,
    "soma in capitals": changed(SOMA, str.upper),
    "soma prefixed": changed(SOMA, "human:{}".format),
    "makehuman capture": MAKEHUMAN_BVH,
    "mmd": MMD,
    "mmd in blender": changed(MMD, dotted),
    "mmd in katakana": MMD.replace("ひざ", "ヒザ").replace("ひじ", "ヒジ"),
    "mmd in kanji": MMD.replace("ひざ", "膝").replace("ひじ", "肘").replace("人指", "人差し指"),
    "mmd in shift jis": changed(MMD, shift_jis),
    "mmd latin": MMD_LATIN,
    "mmd english": MMD_ENGLISH,
    "kinect": KINECT,
    "azure kinect": AZURE_KINECT,
    "optitrack": OPTITRACK,
    "character creator": CHARACTER_CREATOR,
    "second life": SECOND_LIFE,
    "xnalara": XNALARA,
    "arkit": ARKIT,
    "roblox": ROBLOX,
    "smpl in mujoco": MUJOCO_SMPL,
    "mhr": MHR,
    "valve": VALVE,
    "rokoko gloves": ROKOKO_GLOVES,
    "hip helpers": HIP_HELPERS,
    "opensim": OPENSIM,
    "kaykit": KAYKIT,
    "daz 9": DAZ_9,
    "upper arm and arm": ARM_AND_LEG_LAST,
    "upper last": UPPER_LAST,
    "unreal with joints": changed(UNREAL, lambda name: re.sub("_([lr])$", r"_JNT_\1", name)),
    "quick rig": changed(MIXAMO, lambda name: f"QuickRigCharacter1_{name.split(':')[1]}"),
    "wrist and hand": WRIST_AND_HAND,
    "german": GERMAN,
    "german in ascii": changed(GERMAN, lambda name: name.replace("ß", "ss").replace("ä", "ae")
                               .replace("links", "L").replace("rechts", "R")),
    "japanese": JAPANESE,
    "french": FRENCH,
    "french joints": FRENCH_JOINTS,
    "french in ascii": changed(FRENCH, lambda name: name.replace("ê", "e")),
    "spanish": SPANISH,
    "spanish with initials": changed(SPANISH, lambda name: name.replace("Izq", "I")
                                     .replace("Der", "D")),
    "spanish joints": SPANISH_JOINTS,
    "italian": ITALIAN,
    "portuguese": PORTUGUESE,
    "portuguese in ascii": changed(PORTUGUESE, lambda name: name.replace("ç", "c")
                                   .replace("ã", "a").replace("é", "e")),
    "chinese": CHINESE,
    "chinese at the end": changed(CHINESE, lambda name: f"{name[1:]}_{name[0]}"
                                  if name[0] in "左右" else name),
    "chinese in latin letters": CHINESE_LATIN,
    "paws": PAWS,
    "patches": PATCHES,
    "mixamo in one word": changed(MIXAMO, lambda name: name.replace(":", "")),
    "mixamo behind a path": changed(MIXAMO, lambda name: f"Armature|{name}"),
    "mixamo with a suffix": changed(MIXAMO, lambda name: f"{name.split(':')[1]}_jnt"),
    "mixamo in lower case": changed(HIK, lambda name: name[:1].lower() + name[1:]),
    "rigify, deforming": changed(RIGIFY, "DEF-{}".format),
    "old bvh in capitals": changed(OLD_BVH, str.upper),
    "old bvh with dots": changed(OLD_BVH, dotted),
    "unreal without symbols": changed(UNREAL, lambda name: name.replace("_", "")),
    "biped in capitals": changed(BIPED, str.upper),
    "poser in blender": changed(POSER, lambda name: f"{name[1:]}.{name[0].upper()}"
                                if name[0] in "lr" and name[1].isupper() else name),
}  # fmt: skip
